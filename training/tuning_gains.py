"""The numbers of a controller's configuration that a search moves."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from poise.baselines.registry import controller_config, load_controller
from poise.envs.config import to_dict
from poise.envs.errors import ConfigError
from poise.envs.robot import load_robot


@dataclass(frozen=True)
class Gain:
    """One number of the configuration, searched on a log or a linear scale."""

    path: str
    low: float
    high: float

    @property
    def log(self) -> bool:
        """Whether both ends are above 0."""
        return self.low > 0.0

    def value(self, unit: float) -> float:
        """From the search's [0, 1] to the gain."""
        if self.log:
            return float(self.low * (self.high / self.low) ** unit)
        return float(self.low + (self.high - self.low) * unit)

    def unit(self, value: float) -> float:
        """From a gain to [0, 1]."""
        value = min(max(value, self.low), self.high)
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return float((value - self.low) / (self.high - self.low))


class Gains:
    """The gains that are searched, within the configuration of a controller.

    Raises ConfigError naming a path that leads to no number, or a range that is not allowed.
    """

    def __init__(self, controller: str, ranges: Mapping[str, tuple[float, float]], robot: str):
        self.start = to_dict(controller_config(controller))
        self.gains = [Gain(path, low, high) for path, (low, high) in ranges.items()]
        body = load_robot(robot)
        for gain in self.gains:
            for end in (gain.low, gain.high):
                data = self._copy()
                self._put(data, gain.path, end)
                try:
                    load_controller(data, body)
                except ConfigError as error:
                    raise ConfigError(
                        f"{end} is out of range: {error.message}", field=f"gains.{gain.path}"
                    ) from None

    def first(self) -> np.ndarray:
        """(n,) where the search starts, in [0, 1]."""
        return np.array([gain.unit(float(self._at(gain.path))) for gain in self.gains])

    def at(self, units: np.ndarray) -> dict[str, Any]:
        """The controller's configuration at these coordinates."""
        data = self._copy()
        for gain, unit in zip(self.gains, units, strict=True):
            self._put(data, gain.path, gain.value(float(unit)))
        return data

    def _copy(self) -> dict[str, Any]:
        return json.loads(json.dumps(self.start))

    def _at(self, path: str) -> Any:
        return self._parent(self.start, path)[path.split(".")[-1]]

    def _put(self, data: dict[str, Any], path: str, value: float) -> None:
        self._parent(data, path)[path.split(".")[-1]] = float(f"{value:.5g}")

    def _parent(self, data: dict[str, Any], path: str) -> dict[str, Any]:
        *sections, name = path.split(".")
        inner: Any = data
        for section in sections:
            inner = inner.get(section) if isinstance(inner, Mapping) else None
        found = isinstance(inner, Mapping) and name in inner
        if not found or isinstance(inner[name], bool) or not isinstance(inner[name], (int, float)):
            raise ConfigError(
                "the controller has no such number", field=f"gains.{path}",
                choices=sorted(_numbers(data)),
            )  # fmt: skip
        return inner


def _numbers(data: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Paths of all numbers of a configuration."""
    paths = []
    for name, value in data.items():
        if isinstance(value, Mapping):
            paths += _numbers(value, f"{prefix}{name}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            paths.append(prefix + name)
    return paths
