"""The task of the centre of pressure: the rate of angular momentum about the CoM."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import cross
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, TaskTick


@dataclass(frozen=True, eq=False)
class CoPBlock(Block):
    """A CoP task in SI units."""

    weight: np.ndarray  # (3,) ω_p per (N·m)²
    stiffness: float  # s_p [1/s²]
    damping: float  # d_p [1/s]
    horizon: float  # T [s] over which p̈_des is integrated
    angular_damping: float  # k_L [1/s]
    arm: Annotated[np.ndarray, 3]  # scratch: p_des − c


@compiled
def fill_cop(t: TaskTick[CoPBlock]):
    """The rows of a CoP task, see `CoP`."""
    s, p, arm, rows = t.state, t.task, t.task.arm, t.rows
    for a in range(3):
        arm[a] = -s.com[a]
    arm[2] += t.support.origin[2]
    T = p.horizon
    for a in range(2):
        accel = -p.stiffness * (s.cop[a] - t.targets.cop[a]) - p.damping * t.cop_vel[a]
        arm[a] += s.cop[a] + T * t.cop_vel[a] + 0.5 * T * T * accel
    cross(arm, t.force, rows.b)
    for a in range(3):
        rows.b[a] -= p.angular_damping * s.momentum[3 + a]
        rows.weights[a] = p.weight[a]


@dataclass(frozen=True)
class CoP(Task[CoPBlock]):
    """h_p = ‖A_L v̇ + Ȧ_L v − L̇_des‖², L̇_des = (p_des − c) × (Ṗ_des − m g) − k_L L.

    p_des integrates p̈_des = −s_p (p − p_ref) − d_p ṗ over the horizon T from the measured p:
    p_des = p + T ṗ + ½ T² p̈_des. Ṗ_des is that of the CoM task; without one it is zero.
    """

    space: ClassVar[TaskSpace] = TaskSpace.MOMENT
    kernel = staticmethod(fill_cop)

    kind: Literal["cop"] = field(default="cop", metadata={"omit": "default"})
    weight: float = field(default=0.1, metadata={"min": 0.0})  #: per (m g h)²
    yaw_weight: float = field(default=0.1, metadata={"min": 0.0})
    stiffness: float = field(default=20.0, metadata={"min": 0.0})  #: s_p in ω²
    damping: float = field(default=2.0, metadata={"min": 0.0})  #: d_p in ω
    horizon: float = field(default=0.05, metadata={"above": 0.0})  #: in 1/ω
    angular_damping: float = field(default=0.0, metadata={"min": 0.0})  #: k_L in ω

    def bind(self, robot: Robot) -> CoPBlock:
        """The task in SI units."""
        omega, moment = robot.units.omega, robot.units.moment
        return CoPBlock.allocate(
            weight=np.array([self.weight, self.weight, self.yaw_weight]) / moment**2,
            stiffness=self.stiffness * omega**2, damping=self.damping * omega,
            horizon=self.horizon / omega, angular_damping=self.angular_damping * omega,
        )  # fmt: skip

    def rows(self, t: TaskInput, block: CoPBlock) -> Rows:
        state, rate = t.state, desired_moment(t, block)
        return Rows(state.A[3:], rate - state.Adot_v[3:], block.weight)


def desired_cop(t: TaskInput, block: CoPBlock) -> np.ndarray:
    """(3,) p_des after the horizon T of p̈_des = −s_p (p − p_ref) − d_p ṗ, from p and ṗ."""
    T, p = block.horizon, t.state.cop
    accel = -block.stiffness * (p - t.targets.cop) - block.damping * t.cop_vel
    return np.append(p + T * t.cop_vel + 0.5 * T**2 * accel, t.support.origin[2])


def desired_moment(t: TaskInput, block: CoPBlock) -> np.ndarray:
    """L̇_des = (p_des − c) × (Ṗ_des − m g − f) − k_L L [N·m], f the force of a load."""
    arm = desired_cop(t, block) - t.state.com
    return np.cross(arm, t.force) - block.angular_damping * t.state.angular_momentum
