"""The task of small joint torques."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, TaskTick


@dataclass(frozen=True, eq=False)
class TorquesBlock(Block):
    """The weights of torques in SI units."""

    weight: np.ndarray  # (nv−6,) per (N·m)²


@compiled
def fill_torques(t: TaskTick[TorquesBlock]):
    """The rows of small torques, see `Torques`."""
    for a in range(t.rows.b.shape[0]):
        t.rows.b[a], t.rows.weights[a] = 0.0, t.task.weight[a]


@dataclass(frozen=True)
class Torques(Task[TorquesBlock]):
    """‖τ‖² of all joints."""

    space: ClassVar[TaskSpace] = TaskSpace.TORQUES
    kernel = staticmethod(fill_torques)

    kind: Literal["torques"] = "torques"
    weight: float = field(default=0.0, metadata={"min": 0.0})  #: per (m g h)²

    def bind(self, robot: Robot) -> TorquesBlock:
        """The weights in SI units."""
        nj = len(robot.joint_names)
        return TorquesBlock(weight=np.full(nj, self.weight / robot.units.moment**2))

    def rows(self, t: TaskInput, block: TorquesBlock) -> Rows:
        return Rows(t.torques, -t.state.h[6:], block.weight)
