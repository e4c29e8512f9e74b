"""A slope up or down."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .terrain import BEHIND, BEYOND, SIDE, Surface, Terrain


@dataclass(frozen=True)
class Slope(Terrain):
    """A slope of `angle` [°], up or, below zero, down, `length` [m] of it along the ground.

    There are `start` [m] of level ground before it, and level ground behind it.
    """

    kind: Literal["slope"] = "slope"
    angle: float = field(default=8.0, metadata={"min": -45.0, "max": 45.0})
    length: float = field(default=6.0, metadata={"above": 0.0, "max": 100.0})
    start: float = field(default=0.5, metadata={"min": 0.0, "max": 20.0})

    def nominal(self) -> list[Surface]:
        gradient = float(np.tan(np.radians(self.angle)))
        end, top = self.start + self.length, self.length * gradient
        return [
            Surface(-BEHIND, self.start, -SIDE, SIDE, 0.0, 0.0),
            Surface(self.start, end, -SIDE, SIDE, 0.5 * top, gradient),
            Surface(end, end + BEYOND, -SIDE, SIDE, top, 0.0),
        ]
