"""The numbers of a controller's configuration that a search moves."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from poise.baselines.registry import controller_config, load_controller
from poise.configs.errors import ConfigError
from poise.configs.schema import to_dict
from poise.envs.robots.robot import load_robot


@dataclass(frozen=True)
class SearchedGain:
    """One number of the configuration, searched on a log or a linear scale."""

    path: str
    low: float
    high: float

    @property
    def log(self) -> bool:
        """True if both ends are above 0."""
        return self.low > 0.0

    def value(self, unit: float) -> float:
        """Return the gain that belongs to a number of the search, in [0, 1]."""
        if self.log:
            return float(self.low * (self.high / self.low) ** unit)
        return float(self.low + (self.high - self.low) * unit)

    def unit(self, value: float) -> float:
        """Return the number of the search, in [0, 1], that belongs to a gain."""
        value = min(max(value, self.low), self.high)
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return float((value - self.low) / (self.high - self.low))


class Gains:
    """The gains that are searched, within the configuration of a controller.

    A range reaches to where the search starts, if the controller's own number is outside of it.

    Raises ConfigError naming a path that leads to no number, or a range that is not allowed.
    """

    def __init__(self, controller: str, ranges: Mapping[str, tuple[float, float]], robot: str):
        self.start = to_dict(controller_config(controller))
        for stand_in in ("uncertain", "uncertain_from"):  # this controller's gains are searched
            self.start.pop(stand_in, None)
        self.gains: list[SearchedGain] = []
        body, numbers = load_robot(robot), _numbers(self.start)
        for path, (low, high) in ranges.items():
            if path not in numbers:
                raise ConfigError("the controller has no such number", field=f"gains.{path}",
                                  choices=sorted(numbers))  # fmt: skip
            gain = SearchedGain(path, min(low, numbers[path]), max(high, numbers[path]))
            self.gains.append(gain)
            for end in (gain.low, gain.high):
                data = deepcopy(self.start)
                _put(data, gain.path, end)
                try:
                    load_controller(data, body)
                except ConfigError as error:
                    raise ConfigError(
                        f"{end} is out of range: {error.message}", field=f"gains.{gain.path}"
                    ) from None

    def first(self) -> np.ndarray:
        """Return (n,) where the search starts, in [0, 1]."""
        values = _numbers(self.start)
        return np.array([gain.unit(values[gain.path]) for gain in self.gains])

    def at(self, units: np.ndarray) -> dict[str, object]:
        """Return the controller's configuration at these coordinates."""
        data = deepcopy(self.start)
        for gain, unit in zip(self.gains, units, strict=True):
            _put(data, gain.path, gain.value(float(unit)))
        return data


def _put(data: dict[str, Any], path: str, value: float) -> None:
    """Set a number of a configuration, to five digits."""
    *sections, name = path.split(".")
    for section in sections:
        data = data[section]
    data[name] = float(f"{value:.5g}")


def _numbers(data: Mapping[str, object], prefix: str = "") -> dict[str, float]:
    """Return all numbers of a configuration by their paths."""
    found: dict[str, float] = {}
    for name, value in data.items():
        if isinstance(value, Mapping):
            found |= _numbers(value, f"{prefix}{name}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            found[prefix + name] = float(value)
    return found
