"""The limit on the speeds of joints, such as the no-load speed of their motors."""

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
class JointSpeedBlock(Block):
    """A speed limit in SI units. Write `largest` to move it."""

    joints: np.ndarray  # (k,) int
    largest: np.ndarray  # (k,) v_max [rad/s]
    horizon: float  # [s]
    floor: float  # [rad/s²] braking is never asked to exceed


@compiled
def fill_joint_speed(t: LimitTick[JointSpeedBlock]):
    """Fill the rows of a speed limit, see `JointSpeed`."""
    motion, limit, rows = t.motion, t.limit, t.rows
    for r in range(limit.joints.shape[0]):
        dof = 6 + limit.joints[r]
        copy_into(motion.V[dof], rows.C[r])
        v, largest = t.state.qvel[dof], limit.largest[r]
        low = min((-largest - v) / limit.horizon, limit.floor)
        high = max((largest - v) / limit.horizon, -limit.floor)
        rows.l[r], rows.u[r] = low - motion.vdot0[dof], high - motion.vdot0[dof]


@dataclass(frozen=True)
class JointSpeed(Limit[JointSpeedBlock]):
    """|v + T v̇| ≤ v_max of some joints: what is faster is braked to v_max within a horizon T.

    No more braking is asked for than `floor`.
    """

    kernel: ClassVar = staticmethod(fill_joint_speed)

    largest: float = field(metadata={"above": 0.0})  #: v_max in ω
    joints: tuple[str, ...] = ("*",)  #: names or patterns
    kind: Literal["joint-speed"] = "joint-speed"
    horizon: float = field(default=0.1, metadata={"above": 0.0})  #: T in 1/ω
    floor: float = field(default=20.0, metadata={"above": 0.0})  #: in ω²

    def bind(self, robot: Robot) -> JointSpeedBlock:
        joints, omega = joint_indices(robot, self.joints), robot.units.omega
        return JointSpeedBlock(
            joints=joints, largest=np.full(len(joints), self.largest * omega),
            horizon=float(self.horizon / omega), floor=float(self.floor * omega**2),
        )  # fmt: skip

    def size(self, block: JointSpeedBlock) -> int:
        return len(block.joints)

    def rows(self, state: RobotState, block: JointSpeedBlock, torques: np.ndarray) -> Bounds:
        dofs = 6 + block.joints
        v = state.qvel[dofs]
        low = np.minimum((-block.largest - v) / block.horizon, block.floor)
        high = np.maximum((block.largest - v) / block.horizon, -block.floor)
        return Bounds(np.eye(len(state.qvel))[dofs], low, high)
