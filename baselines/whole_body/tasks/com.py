"""The task of the centre of mass: the rate of linear momentum."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, TaskTick


@dataclass(frozen=True, eq=False)
class CoMBlock(Block):
    """A CoM task in SI units."""

    mass: float  # of the robot [kg]
    gravity: float  # [m/s²]
    weight: np.ndarray  # (3,) ω_c per N²
    stiffness: np.ndarray  # (3,) s_c [1/s²]
    damping: np.ndarray  # (3,) d_c [1/s]


@compiled
def fill_com(t: TaskTick[CoMBlock]):
    """The rows of a CoM task, see `CoM`: the desired force is Ṗ_des − m g."""
    s, targets, c, rows = t.state, t.targets, t.task, t.rows
    for a in range(3):
        rows.b[a] = c.mass * (
            targets.com_acc[a]
            + c.stiffness[a] * (targets.com[a] - s.com[a])
            + c.damping[a] * (targets.com_vel[a] - s.com_vel[a])
        )
        rows.weights[a] = c.weight[a]
    rows.b[2] += c.mass * c.gravity - s.load[0]


@dataclass(frozen=True)
class CoM(Task[CoMBlock]):
    """h_c = ‖A_P v̇ + Ȧ_P v − Ṗ_des‖², Ṗ_des = m (c̈_ref + s_c (c_ref − c) + d_c (ċ_ref − ċ)).

    s_c is `stiffness` ω², d_c = 2 ζ √s_c; `height_…` are those of the vertical row. `offset` moves
    the default c_ref and p_ref forward of the middle of the soles, in h, on a robot whose
    description has `posture.com: controller`; others stand as their posture has the CoM.
    """

    space: ClassVar[TaskSpace] = TaskSpace.FORCE
    kernel = staticmethod(fill_com)

    kind: Literal["com"] = field(default="com", metadata={"omit": "default"})
    weight: float = field(default=3600.0, metadata={"min": 0.0})  #: per (m g)²
    height_weight: float = field(default=3600.0, metadata={"min": 0.0})
    stiffness: float = field(default=3.0, metadata={"min": 0.0})  #: in ω²
    height_stiffness: float = field(default=3.0, metadata={"min": 0.0})
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})  #: ζ
    offset: float = field(default=0.0, metadata={"min": -0.2, "max": 0.2})

    def bind(self, robot: Robot) -> CoMBlock:
        """The task in SI units."""
        omega, force = robot.units.omega, robot.units.force
        stiffness = np.array([self.stiffness, self.stiffness, self.height_stiffness])
        return CoMBlock(
            mass=robot.mass, gravity=robot.units.gravity,
            weight=np.array([self.weight, self.weight, self.height_weight]) / force**2,
            stiffness=stiffness * omega**2,
            damping=2.0 * self.damping_ratio * np.sqrt(stiffness) * omega,
        )  # fmt: skip

    def rows(self, t: TaskInput, block: CoMBlock) -> Rows:
        state, targets = t.state, t.targets
        rate = block.mass * (
            targets.com_acc
            + block.stiffness * (targets.com - state.com)
            + block.damping * (targets.com_vel - state.com_vel)
        )
        return Rows(state.A[:3], rate - state.Adot_v[:3], block.weight)
