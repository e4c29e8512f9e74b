"""Level ground with small bumps that no planner or controller models."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .terrain import Surface, Terrain


@dataclass(frozen=True)
class Bumps(Terrain):
    """`count` bumps, squares of a `side` [m], at random within a `radius` around the start [m].

    Each is between `lowest` and `highest` high [m]. The ground is level within `clear` [m] of the
    start, where the feet stand. A planner assumes level ground, whatever `unseen` says.
    """

    kind: Literal["bumps"] = "bumps"
    count: int = field(default=120, metadata={"min": 1, "max": 1000})
    side: float = field(default=0.1, metadata={"above": 0.0, "max": 1.0})
    radius: float = field(default=1.5, metadata={"above": 0.0, "max": 20.0})
    clear: float = field(default=0.3, metadata={"min": 0.0, "max": 10.0})
    lowest: float = field(default=0.0, metadata={"min": 0.0, "max": 0.2})
    highest: float = field(default=0.015, metadata={"above": 0.0, "max": 0.2})

    def __post_init__(self) -> None:
        if self.lowest > self.highest:
            raise ValueError(
                f"lowest: {self.lowest:g} m must be at most highest, {self.highest:g} m"
            )
        if self.clear >= self.radius:
            raise ValueError(f"clear: {self.clear:g} m must be below radius, {self.radius:g} m")

    def nominal(self) -> list[Surface]:
        rng = np.random.default_rng([self.seed, 0])
        half = 0.5 * self.side
        reach = self.clear + np.hypot(half, half)  # so that no corner is in what is clear
        distance = np.sqrt(rng.uniform(reach**2, max(self.radius, reach) ** 2, self.count))
        angle = rng.uniform(-np.pi, np.pi, self.count)
        height = rng.uniform(self.lowest, self.highest, self.count)
        bumps = [
            Surface(x - half, x + half, y - half, y + half, z, 0.0)
            for x, y, z in zip(
                (distance * np.cos(angle)).tolist(),
                (distance * np.sin(angle)).tolist(),
                height.tolist(),
                strict=True,
            )
        ]
        bumps.sort()
        return [Surface(-self.clear, self.clear, -self.clear, self.clear, 0.0, 0.0), *bumps]

    def assumed(self) -> list[Surface]:
        return []
