"""The task of small wrenches of the soles."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, TaskTick


@dataclass(frozen=True, eq=False)
class WrenchesBlock(Block):
    """The weights of wrenches in SI units."""

    force_weight: float  # per N²
    moment_weight: float  # per (N·m)²


@compiled
def fill_wrenches(t: TaskTick[WrenchesBlock]):
    """The rows of small wrenches, see `Wrenches`."""
    weights = t.rows.weights
    for r in range(weights.shape[0]):
        t.rows.b[r] = 0.0
        weights[r] = t.task.force_weight if r % 6 < 3 else t.task.moment_weight


@dataclass(frozen=True)
class Wrenches(Task[WrenchesBlock]):
    """‖w‖² of the soles' forces and moments, which also shares a load between two soles."""

    space: ClassVar[TaskSpace] = TaskSpace.WRENCHES
    kernel = staticmethod(fill_wrenches)

    kind: Literal["wrenches"] = "wrenches"
    force_weight: float = field(default=1e-3, metadata={"above": 0.0})  #: per (m g)²
    moment_weight: float = field(default=1e-3, metadata={"above": 0.0})  #: per (m g h)²

    def bind(self, robot: Robot) -> WrenchesBlock:
        """The weights in SI units."""
        return WrenchesBlock(
            force_weight=self.force_weight / robot.units.force**2,
            moment_weight=self.moment_weight / robot.units.moment**2,
        )

    def rows(self, t: TaskInput, block: WrenchesBlock) -> Rows:
        nv, k = len(t.state.qvel), len(t.support.J)
        weights = np.tile(np.repeat([block.force_weight, block.moment_weight], 3), k // 6)
        return Rows(np.eye(k, nv + k, nv), np.zeros(k), weights)
