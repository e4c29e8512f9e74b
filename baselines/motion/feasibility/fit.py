"""A motion changed until the robot can do it: slower, or with its centre of mass elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from poise.baselines.balance.references.foot_steps import plan_of
from poise.baselines.balance.references.footing import sole_poses
from poise.baselines.balance.references.footwork import com_over, perform_plan
from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.compiled.maths.polygons import half_planes, nearest_inside
from poise.envs.robots.robot import Robot

from .check import RATE, Feasibility, FeasibilityLimits, check_motion, judge
from .split import bearable_region
from .trajectory import PlantedRobot, Trajectory, joints_of, sample_trajectory

TEMPOS = (0.9, 0.8, 0.7, 0.6, 0.5)
ROUNDS = 6  # times that the CoM is moved
INWARD = 0.01  # [m] that the ZMP is taken further inside than is needed
UNREACHED = 1e-5  # [m, rad] of the soles
TOGETHER, LOADS = 10, 5  # samples, and parts of the weight, that have one region
OVER = 1e-3  # [rad] over a joint's range that is cut


class NotFitted(PoiseError):
    """Neither a slower tempo nor a moved centre of mass makes the motion possible."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A motion that a robot can do.

    Attributes:
        clip: the motion.
        tempo: of it, over that of what was given.
        moved: largest way that the CoM was moved over the ground [m].
        feasibility: of the motion.
    """

    clip: RobotClip
    tempo: float
    moved: float
    feasibility: Feasibility


def fit_motion(clip: RobotClip, robot: Robot, limits: FeasibilityLimits | None = None) -> Fitted:
    """The first of these that keeps the limits: as it is, slower, with the CoM moved, both.

    Tempos are 0.9, 0.8, … 0.5. The CoM is moved over the ground, with trunk and arms as they are
    and legs that reach their soles, see `moved_com`. With steps the CoM is planned again at every
    tempo, see `perform_plan`.

    Raises:
        NotFitted: nothing helps; the worst sample is named.
        ConfigError: the clip is no motion of this robot.
    """
    slowed = [(1.0, clip), *((tempo, replace(clip, dt=clip.dt / tempo)) for tempo in TEMPOS)]
    if clip.planted is not None:
        return _fit_steps(slowed, clip.planted, robot, limits)
    for tempo, slow in slowed:
        judged = check_motion(slow, robot, limits)
        if judged.feasible:
            return Fitted(slow, tempo, 0.0, judged)
    nearest = judged
    for tempo, slow in slowed:
        moved, way = moved_com(slow, robot, limits)
        judged = check_motion(moved, robot, limits)
        if judged.feasible:
            return Fitted(moved, tempo, way, judged)
        nearest = min(nearest, judged, key=lambda one: one.lacking)
    raise NotFitted(f"{clip.about.name}: no tempo from 0.5 on and no shift of the centre of mass "
                    f"makes it possible: {nearest.reason}")  # fmt: skip


def _fit_steps(
    slowed: Sequence[tuple[float, RobotClip]], planted: np.ndarray, robot: Robot,
    limits: FeasibilityLimits | None,
) -> Fitted:  # fmt: skip
    """Return the first feasible tempo of a motion with steps, or with its CoM replanned."""
    judged = check_motion(slowed[0][1], robot, limits)
    if judged.feasible:
        return Fitted(slowed[0][1], 1.0, 0.0, judged)
    reason, least = judged.reason, judged.lacking
    for tempo, slow in slowed:
        name = slow.about.name
        try:
            qpos = perform_plan(robot, plan_of(robot, slow.qpos, slow.dt, planted), name)
        except ConfigError:  # limbs that swing too fast at this tempo
            continue
        made = replace(slow, qpos=qpos)
        judged = check_motion(made, robot, limits)
        if judged.feasible:
            way = (sole_poses(robot, qpos)[0] - sole_poses(robot, slow.qpos)[0])[:, :2]
            return Fitted(made, tempo, float(np.linalg.norm(way, axis=1).max()), judged)
        if judged.lacking < least:
            reason, least = judged.reason, judged.lacking
    raise NotFitted(f"{slowed[0][1].about.name}: no tempo from 0.5 on with the centre of mass "
                    f"planned again makes it possible: {reason}")  # fmt: skip


def moved_com(
    clip: RobotClip, robot: Robot, limits: FeasibilityLimits | None = None
) -> tuple[RobotClip, float]:
    """The motion with its CoM moved so that the ZMP is where it can be, and by how much [m].

    Where the ZMP p or a torque is out of bounds, p + δp is the nearest place that motors and soles
    can bear. With δp = 0 elsewhere and δc = 0 at both ends, the CoM's offset solves

        δc − h/(g + c̈_z) δc̈ = δp,

    a tridiagonal system. Legs then reach for their soles, which changes δp: a few rounds.
    """
    limits = limits or FeasibilityLimits()
    planted, legs = PlantedRobot(robot), PlantedLegs(robot)
    first = reference_from(clip, robot, clip.about.name)
    times = np.arange(0.0, clip.duration + 1e-9, 1.0 / RATE)
    best, offset, total = clip, np.zeros((len(times), 2)), 0.0
    least = np.inf
    motion: ReferenceMotion = first
    for _ in range(ROUNDS):
        path = sample_trajectory(planted, joints_of(motion), times)
        judged = judge(robot, path, limits)
        if judged.lacking < least:
            best, least = clip, judged.lacking
            total = float(np.linalg.norm(offset, axis=1).max())
        if judged.feasible:
            break
        wanted = _wanted(planted, path, judged)
        if wanted is None or judged.lacking > least:
            break
        offset = offset + zmp_offset(path, wanted, robot.units.gravity)
        moved = _with_offset(clip, first, legs, times, offset)
        if moved is None:
            break
        clip, motion = moved, reference_from(moved, robot, clip.about.name)
    return best, total


def zmp_offset(path: Trajectory, wanted: np.ndarray, gravity: float) -> np.ndarray:
    """(n, 2) δc of δc − h/(g + c̈_z) δc̈ = `wanted` (n, 2), 0 at both ends [m]."""
    step = path.times[1] - path.times[0]
    height = path.com[:, 2] - path.height
    share = height / (gravity + path.com_acc[:, 2]) / step**2
    still = np.zeros(2)
    return com_over(wanted, share, still, still)


def _wanted(planted: PlantedRobot, path: Trajectory, judged: Feasibility) -> np.ndarray | None:
    """(n, 2) by which the ZMP is to move [m]; None where the motors do not hold the posture."""
    limits, wanted = judged.limits, np.zeros_like(judged.zmp)
    lacks = (judged.zmp_margin < limits.zmp_margin) | (judged.torque.max(axis=1) > limits.torque)
    known: dict[tuple[int, int], np.ndarray | None] = {}
    for k in np.flatnonzero(lacks):
        key = int(k) // TOGETHER, int(np.ceil(LOADS * judged.load[k]))
        if key not in known:
            known[key] = bearable_region(planted, path.qpos[k, 7:], key[1] / LOADS, limits.torque)
        region = known[key]
        if region is None:
            return None
        goal = nearest_inside(_inner(region, INWARD), judged.zmp[k])
        wanted[k] = nearest_inside(_inner(judged.support, limits.zmp_margin + INWARD), goal)
        wanted[k] -= judged.zmp[k]
    return wanted


def _inner(polygon: np.ndarray, margin: float) -> np.ndarray:
    """The polygon scaled about its middle until its nearest edge is `margin` [m] further in."""
    middle = polygon.mean(axis=0)
    normals, offsets = half_planes(polygon)
    nearest = float((offsets - normals @ middle).min())
    return np.asarray(middle + max(0.0, 1.0 - margin / nearest) * (polygon - middle))


def _with_offset(
    clip: RobotClip, first: ReferenceMotion, legs: PlantedLegs, times: np.ndarray,
    offset: np.ndarray,
) -> RobotClip | None:  # fmt: skip
    """The first motion with its CoM moved by (n, 2) at `times`; None if legs cannot."""
    low, high = legs.robot.joint_range.T
    qpos = np.empty_like(clip.qpos)
    for k, before in enumerate(clip.qpos):
        sample = first.sample(k * clip.dt)
        way = [np.interp(k * clip.dt, times, offset[:, axis]) for axis in range(2)]
        com, others = sample.com_offset + [*way, 0.0], sample.q_ref[legs.others]
        qpos[k], error = legs.reach(com, sample.root, others, before[7:])
        over = np.maximum(low - qpos[k, 7:], qpos[k, 7:] - high).max()
        if error > UNREACHED or over > OVER:
            return None
    qpos[:, 7:] = np.clip(qpos[:, 7:], low, high)
    return replace(clip, qpos=qpos)
