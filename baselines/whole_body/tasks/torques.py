"""The task of small joint torques."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, fill_small


@dataclass(frozen=True, eq=False)
class TorquesBlock(Block):
    """The weights of torques in SI units."""

    weight: np.ndarray  # (nv−6,) per (N·m)²


@dataclass(frozen=True)
class Torques(Task[TorquesBlock]):
    """‖τ‖² of all joints."""

    space: ClassVar[TaskSpace] = TaskSpace.TORQUES
    kernel = staticmethod(fill_small)

    kind: Literal["torques"] = "torques"
    weight: float = field(default=0.0, metadata={"min": 0.0})  #: per (m g h)²

    def bind(self, robot: Robot) -> TorquesBlock:
        """The weights in SI units."""
        nj = len(robot.joint_names)
        return TorquesBlock(weight=np.full(nj, self.weight / robot.units.moment**2))

    def rows(self, t: TaskInput, block: TorquesBlock) -> Rows:
        return Rows(t.torques, -t.state.h[6:], block.weight)
