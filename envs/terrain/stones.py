"""Stepping stones, and ground of tiles that do not lie level with each other."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .terrain import BEHIND, BEYOND, SIDE, Surface, Terrain


@dataclass(frozen=True)
class Stones(Terrain):
    """`count` stones of a `length`, a `gap` between two [m], their heights within ± `spread` [m].

    The floor is `depth` [m] below the start. Without a gap they are tiles.
    """

    kind: Literal["stones"] = "stones"
    count: int = field(default=12, metadata={"min": 1, "max": 200})
    length: float = field(default=0.30, metadata={"above": 0.0, "max": 5.0})
    gap: float = field(default=0.0, metadata={"min": 0.0, "max": 2.0})
    spread: float = field(default=0.0, metadata={"min": 0.0, "max": 0.5})
    depth: float = field(default=0.3, metadata={"min": 0.0, "max": 5.0})
    start: float = field(default=0.5, metadata={"min": 0.0, "max": 20.0})

    def nominal(self) -> list[Surface]:
        heights = np.random.default_rng([self.seed, 0]).uniform(-1.0, 1.0, self.count) * self.spread
        pitch = self.length + self.gap
        first = self.start + self.gap
        stones = [
            Surface(x, x + self.length, -SIDE, SIDE, float(height), 0.0)
            for x, height in zip(first + pitch * np.arange(self.count), heights, strict=True)
        ]
        end = stones[-1].x_max + self.gap
        bank = Surface(end, end + BEYOND, -SIDE, SIDE, 0.0, 0.0)
        return [Surface(-BEHIND, self.start, -SIDE, SIDE, 0.0, 0.0), *stones, bank]

    def floor(self) -> float:
        return super().floor() - self.depth
