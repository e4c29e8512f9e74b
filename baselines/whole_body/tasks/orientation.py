"""The task of holding a body's orientation, such as a level trunk."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into, turn_error, turned
from poise.envs.physics.body_points import (
    BodyPoint,
    body_point,
    point_motion,
    standing_frame,
    update_point,
)
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskTick, spring


@dataclass(frozen=True, eq=False)
class OrientationBlock(Block):
    """An orientation task in SI units. Write `axes` to turn the reference."""

    point: BodyPoint
    axes: np.ndarray  # (3, 3) R_ref in the heading frame, or in the world
    turns: bool  # true: the reference turns with the heading
    k: float  # [1/s²]
    d: float  # [1/s]
    weight: float  # per (rad/s²)²
    desired: Annotated[np.ndarray, 3, 3]  # scratch: R_ref in the world
    error: Annotated[np.ndarray, 3]  # scratch


@compiled
def fill_orientation(t: TaskTick[OrientationBlock]):
    """The rows of an orientation task, see `Orientation`."""
    s, o, rows = t.state, t.task, t.rows
    point, R, error = o.point, s.body_axes[o.point.body], o.error
    update_point(s, point)
    cos, sin = (s.heading[0], s.heading[1]) if o.turns else (1.0, 0.0)
    for c in range(3):
        o.desired[0, c], o.desired[1, c] = turned(cos, sin, o.axes[0, c], o.axes[1, c])
        o.desired[2, c] = o.axes[2, c]
    gain = o.k * turn_error(R, o.desired, error)
    for a in range(3):
        turn = R[a, 0] * error[0] + R[a, 1] * error[1] + R[a, 2] * error[2]
        rows.b[a] = gain * turn - o.d * point.J_v[3 + a] - point.Jdot_v[3 + a]
        rows.weights[a] = o.weight
        copy_into(point.J[3 + a], rows.A[a])


@dataclass(frozen=True)
class Orientation(Task[OrientationBlock]):
    """J_ω v̇ + J̇_ω v = k (R_ref ⊖ R) − d ω: a body keeps its axes R at R_ref.

    R_ref ⊖ R is the rotation vector of R_ref Rᵀ, ω the angular velocity, world axes; k is
    `stiffness` ω², d = 2 ζ √k. R_ref is the body's orientation when the robot stands, and turns
    with the heading of the feet unless `frame` is "world".
    """

    size: ClassVar[int] = 3
    kernel = staticmethod(fill_orientation)

    body: str  #: name of the body
    kind: Literal["orientation"] = "orientation"
    frame: Literal["heading", "world"] = "heading"  #: what the reference is fixed to
    weight: float = field(default=1.0, metadata={"min": 0.0})  #: per (g/h)²
    stiffness: float = field(default=20.0, metadata={"min": 0.0})  #: k in ω²
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})  #: ζ

    def bind(self, robot: Robot) -> OrientationBlock:
        """The task in SI units, its reference that of the standing robot."""
        units, point = robot.units, body_point(robot, self.body, (0.0, 0.0, 0.0))
        k, d = spring(units, self.stiffness, self.damping_ratio)
        return OrientationBlock.allocate(
            point=point, axes=standing_frame(robot, point)[1], turns=self.frame == "heading",
            k=k, d=d, weight=float(self.weight / units.omega**4),
        )  # fmt: skip

    def rows(self, t: TaskInput, block: OrientationBlock) -> Rows:
        state = t.state
        motion = point_motion(state, block.point)
        yaw = state.heading_yaw if block.turns else 0.0
        desired = Rotation.from_euler("z", yaw).as_matrix() @ block.axes
        turn = Rotation.from_matrix(desired @ motion.axes.T).as_rotvec()
        b = block.k * turn - block.d * motion.J_v[3:] - motion.Jdot_v[3:]
        return Rows(motion.J[3:], b, np.full(3, block.weight))
