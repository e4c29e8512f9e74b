"""The task of a small wrench on a soft root."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, fill_small


@dataclass(frozen=True, eq=False)
class RootWrenchBlock(Block):
    """The weights of u_root in SI units."""

    weight: np.ndarray  # (6,) ω_root per N² and per (N·m)²


@dataclass(frozen=True)
class RootWrench(Task[RootWrenchBlock]):
    """ω_root ‖u_root‖²: what a soft root must not lean on. With a hard root it has no rows."""

    space: ClassVar[TaskSpace] = TaskSpace.ROOT
    kernel = staticmethod(fill_small)

    kind: Literal["root-wrench"] = "root-wrench"
    weight: float = field(default=1e3, metadata={"above": 0.0})  #: per (m g)² and (m g h)²

    def bind(self, robot: Robot) -> RootWrenchBlock:
        """The weights in SI units."""
        return RootWrenchBlock(
            weight=self.weight / np.repeat([robot.units.force, robot.units.moment], 3) ** 2
        )

    def rows(self, t: TaskInput, block: RootWrenchBlock) -> Rows:
        start = t.torques.shape[1]
        return Rows(np.eye(6, start + 6, start), np.zeros(6), block.weight)
