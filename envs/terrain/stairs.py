"""Stairs up or down."""

from dataclasses import dataclass, field
from typing import Literal

from .terrain import BEHIND, BEYOND, SIDE, Surface, Terrain


@dataclass(frozen=True)
class Stairs(Terrain):
    """`count` steps of one `rise` and one `tread` [m], after `start` [m] of level ground.

    The last one goes on as a landing. With `down` they lead below the start.
    """

    kind: Literal["stairs"] = "stairs"
    count: int = field(default=9, metadata={"min": 1, "max": 200})
    rise: float = field(default=0.10, metadata={"above": 0.0, "max": 1.0})
    tread: float = field(default=0.30, metadata={"above": 0.0, "max": 5.0})
    down: bool = False
    start: float = field(default=0.5, metadata={"min": 0.0, "max": 20.0})

    def nominal(self) -> list[Surface]:
        step = -self.rise if self.down else self.rise
        edges = [self.start + k * self.tread for k in range(self.count)]
        edges = [-BEHIND, *edges, edges[-1] + self.tread + BEYOND]
        return [
            Surface(edges[k], edges[k + 1], -SIDE, SIDE, k * step, 0.0)
            for k in range(self.count + 1)
        ]
