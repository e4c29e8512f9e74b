"""The limit on the torques of some joints, below what their motors can."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .limit import Bounds, Limit, LimitTick, joint_indices


@dataclass(frozen=True, eq=False)
class TorqueBlock(Block):
    """A torque limit in SI units. Write `largest` to move it."""

    joints: np.ndarray  # (k,) int
    largest: np.ndarray  # (k,) [N·m]


@compiled
def fill_torque(t: LimitTick[TorqueBlock]):
    """Fill the rows of a torque limit, see `Torque`."""
    motion, limit, rows = t.motion, t.limit, t.rows
    for r in range(limit.joints.shape[0]):
        a = limit.joints[r]
        copy_into(motion.T[a], rows.C[r])
        rows.l[r] = -limit.largest[r] - motion.tau0[a]
        rows.u[r] = limit.largest[r] - motion.tau0[a]


@dataclass(frozen=True)
class Torque(Limit[TorqueBlock]):
    """|τ| ≤ `share` · τ_max of some joints; those without a motor have τ_max = 0."""

    kernel: ClassVar = staticmethod(fill_torque)

    joints: tuple[str, ...] = ("*",)  #: names or patterns
    kind: Literal["torque"] = "torque"
    share: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})  #: of τ_max

    def bind(self, robot: Robot) -> TorqueBlock:
        largest, joints = np.zeros(len(robot.joint_names)), joint_indices(robot, self.joints)
        largest[robot.motor_dofs - 6] = self.share * robot.torque_limit
        return TorqueBlock(joints=joints, largest=largest[joints])

    def size(self, block: TorqueBlock) -> int:
        return len(block.joints)

    def rows(self, state: RobotState, block: TorqueBlock, torques: np.ndarray) -> Bounds:
        bias = state.h[6:][block.joints]
        return Bounds(torques[block.joints], -block.largest - bias, block.largest - bias)
