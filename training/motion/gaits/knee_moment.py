"""The moment of the human knee over stance, which knees of robots are compared with."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml

POINTS = 51  # of a curve over stance


@dataclass(frozen=True)
class KneeMoment:
    """The knee's moment in the sagittal plane, extension positive, at points of stance."""

    source: str  #: where the figures are from
    stance: tuple[float, ...]  #: rising from 0 to 100 [%]
    mean: tuple[float, ...]  #: [N·m/kg]
    half_width: tuple[float, ...]  #: of the band [N·m/kg]

    def __post_init__(self) -> None:
        if not len(self.stance) == len(self.mean) == len(self.half_width) >= 2:
            raise ValueError("stance: must be as long as mean and half_width, two points or more")
        if self.stance[0] != 0.0 or self.stance[-1] != 100.0 or np.any(np.diff(self.stance) <= 0):
            raise ValueError("stance: must rise from 0 to 100")
        if min(self.half_width) < 0.0:
            raise ValueError("half_width: must not be negative")

    def curves(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and half width (51,) [N·m/kg] at every 2 % of stance, linear between the points."""
        at = np.linspace(0.0, 100.0, POINTS)
        return np.interp(at, self.stance, self.mean), np.interp(at, self.stance, self.half_width)


def load_knee_moment(name: str | Path = "knee-moment") -> KneeMoment:
    """A packaged band, or that of a YAML file; raises ConfigError for one that is not valid."""
    path = resolve("human", name)
    return build(KneeMoment, read_yaml(path), path)
