"""Friction of the ground, estimated from sliding soles.

A sole that slides bears as much along the ground as friction lets it, so the ratio of what it bears
along and across is the friction [Caron15]. Before it slides the estimate is the model's value.
"""

from __future__ import annotations

from dataclasses import dataclass

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot

from .measurement import Rings

PIVOTS = 1.25  # sliding soles pivot as well: they bear four fifths of what they could
STEP = 0.02  # of the model's friction, by which a tick changes the estimate, after the first
BEARS = 0.2  # of the weight, that they bear at least
LEAST = 0.3  # of the friction of the model: the least estimate


@dataclass(eq=False)
class SlidingFriction(Block):
    """Measurements of the friction while soles slid."""

    known: float  # friction of the model
    speed: Mutable[float]  # from which a sole is taken to slide [m/s]; 0: never
    last: Mutable[float]  # ratio of the tick before, if soles slid in it, else 0
    measured: Mutable[int]  # 1 once a sole has slid


def allocate_friction(robot: Robot) -> SlidingFriction:
    """The friction of a robot's soles on its ground."""
    geoms = [geom for sole in robot.soles for geom in sole.geom_ids]
    known = contact_friction(robot.model, robot.ground_geom_id, geoms)
    return SlidingFriction.allocate(known=known)


def begin_friction(f: SlidingFriction, s: StateArrays, speed: float) -> None:
    """Start an episode, in which nothing has slid; see `SlidingFriction.speed`."""
    f.speed, f.last, f.measured = speed, 0.0, 0
    s.friction = 1.0


@compiled
def learn_friction(f: SlidingFriction, robot: RobotArrays, s: StateArrays, rings: Rings, row: int):
    """Estimate `s.friction` from sliding soles, over the model's friction:

        μ = PIVOTS (|f_x| + |f_y|)/f_z,

    the mean of two ticks in a row. f, the force of the ground that was measured last, has the axes
    of the sliding sole, as in the cone of the QP. The first value sets the estimate. Later ticks
    change it by little, since a sole that lands bears any force.
    """
    slides = sliding_sole(s, f.speed) if f.speed > 0.0 else -1
    force, R, axes = rings.wrench[row], s.root_axes, s.sole_axes[slides]
    x, y, z = 0.0, 0.0, 0.0
    for a in range(3):
        world = R[a, 0] * force[0] + R[a, 1] * force[1] + R[a, 2] * force[2]
        x, y, z = x + axes[a, 0] * world, y + axes[a, 1] * world, z + axes[a, 2] * world
    if slides < 0 or z < BEARS * robot.mass * robot.gravity:
        f.last = 0.0
        return
    ratio, last = (abs(x) + abs(y)) / z, f.last
    f.last = ratio
    if last > 0.0:
        value = 0.5 * PIVOTS * (last + ratio) / f.known
        step = 1.0 if f.measured == 0 else STEP
        change = min(max(value - s.friction, -step), step)
        s.friction = min(max(s.friction + change, LEAST), 1.0)
        f.measured = 1


@compiled
def sliding_sole(s: StateArrays, speed: float) -> int:
    """A sole that touches the ground, if all that do are faster than `speed`; else −1.

    Of a single one the velocity at the CoP counts: one that rolls over an edge does not slide.
    """
    feet, last = 0, -1
    for i in range(s.contacts.shape[0]):
        if s.contacts[i] > 0.5:
            feet, last = feet + 1, i
    for i in range(s.contacts.shape[0]):
        if s.contacts[i] > 0.5:
            x, y, turn = s.J_v[6 * i], s.J_v[6 * i + 1], s.J_v[6 * i + 5]
            if feet == 1:
                x -= turn * (s.cop[1] - s.sole_point[i, 1])
                y += turn * (s.cop[0] - s.sole_point[i, 0])
            if x * x + y * y <= speed * speed:
                return -1
    return last
