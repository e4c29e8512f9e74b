"""The task of holding a point of a body in a place, such as a hand."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into, placed
from poise.envs.physics.body_points import (
    BodyPoint,
    body_point,
    point_motion,
    standing_frame,
    update_point,
)
from poise.envs.physics.legs import standing_data
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskTick, spring


@dataclass(frozen=True, eq=False)
class PositionBlock(Block):
    """A position task in SI units. Write `reference` to move the place."""

    point: BodyPoint
    reference: np.ndarray  # (3, 3) x_ref, ẋ_ref, ẍ_ref [m, s], in the task's frame
    turns: bool  # true: the reference turns with the heading
    about_com: bool  # true: from the CoM, else from the soles' mean or the world's origin
    mass: float  # of the robot [kg]
    gravity: float  # [m/s²]
    k: float  # [1/s²]
    d: float  # [1/s]
    weight: float  # per (m/s²)²


@compiled
def fill_position(t: TaskTick[PositionBlock]):
    """The rows of a position task, see `Position`."""
    s, o, rows = t.state, t.task, t.rows
    point, reference = o.point, o.reference
    update_point(s, point)
    ox, oy, oz, cos, sin = 0.0, 0.0, 0.0, 1.0, 0.0
    if o.turns:
        ox, oy, oz = s.origin[0], s.origin[1], s.origin[2]
        cos, sin = s.heading[0], s.heading[1]
    if o.about_com:
        ox, oy, oz = s.com[0], s.com[1], s.com[2]
    for a in range(3):
        rows.b[a] = -o.k * point.position[a] - o.d * point.J_v[a] - point.Jdot_v[a]
        rows.weights[a] = o.weight
        copy_into(point.J[a], rows.A[a])
        if o.about_com:
            rows.b[a] += o.d * s.com_vel[a] + s.A_bias[a] / o.mass
            for j in range(len(s.qvel)):
                rows.A[a, j] -= s.A[a, j] / o.mass
    if o.about_com:
        rows.b[2] -= o.gravity - s.load[0] / o.mass
    x, y = placed(ox, oy, cos, sin, reference[0, 0], reference[0, 1])
    vx, vy = placed(0.0, 0.0, cos, sin, reference[1, 0], reference[1, 1])
    ax, ay = placed(0.0, 0.0, cos, sin, reference[2, 0], reference[2, 1])
    rows.b[0] += o.k * x + o.d * vx + ax
    rows.b[1] += o.k * y + o.d * vy + ay
    rows.b[2] += o.k * (oz + reference[0, 2]) + o.d * reference[1, 2] + reference[2, 2]


@dataclass(frozen=True)
class Position(Task[PositionBlock]):
    """J v̇ + J̇ v = ẍ_ref + k (x_ref − x) + d (ẋ_ref − ẋ): a point of a body keeps to a place.

    k is `stiffness` ω², d = 2 ζ √k. x_ref is in the heading frame, whose origin is the mean of the
    soles, or with `frame: world` in the world. With `frame: com` x is from the CoM, along the
    heading, and J is J − A_P/m: the head over the CoM of [Zhao]. Left out, x_ref is where the point
    is when the robot stands. The heading is taken to be at rest.
    """

    size: ClassVar[int] = 3
    kernel = staticmethod(fill_position)

    body: str  #: name of the body
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: in the body's axes [m]
    kind: Literal["position"] = "position"
    place: tuple[float, float, float] | None = None  #: x_ref in h
    frame: Literal["heading", "world", "com"] = "heading"  #: what `place` is relative to
    weight: float = field(default=1.0, metadata={"min": 0.0})  #: per g²
    stiffness: float = field(default=20.0, metadata={"min": 0.0})  #: k in ω²
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})  #: ζ

    def bind(self, robot: Robot) -> PositionBlock:
        """The task in SI units, its reference that of the standing robot."""
        units, point = robot.units, body_point(robot, self.body, self.point)
        k, d = spring(units, self.stiffness, self.damping_ratio)
        place = standing_frame(robot, point)[0]
        if self.frame == "com":
            place = place - standing_data(robot).subtree_com[robot.root_body_id]
        if self.place is not None:
            place = units.height * np.array(self.place)
        return PositionBlock(
            point=point, reference=np.array([place, np.zeros(3), np.zeros(3)]),
            turns=self.frame != "world", about_com=self.frame == "com", mass=robot.mass,
            gravity=units.gravity, k=k, d=d, weight=float(self.weight / units.gravity**2),
        )  # fmt: skip

    def rows(self, t: TaskInput, block: PositionBlock) -> Rows:
        state = t.state
        motion = point_motion(state, block.point)
        place, velocity, accel = block.reference
        if block.turns:
            cos, sin = state.heading
            turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
            place, velocity, accel = turn @ place, turn @ velocity, turn @ accel
        x, J, J_v, Jdot_v = motion.position, motion.J[:3], motion.J_v[:3], motion.Jdot_v[:3]
        if block.about_com:
            m = block.mass
            x, J, J_v = x - state.com, J - state.A[:3] / m, J_v - state.com_vel
            Jdot_v = Jdot_v - state.Adot_v[:3] / m
        elif block.turns:
            x = x - state.origin
        desired = accel + block.k * (place - x) + block.d * (velocity - J_v)
        return Rows(J, desired - Jdot_v, np.full(3, block.weight))
