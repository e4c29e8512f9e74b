"""Steps of keyframe motions: when a foot swings, and its path."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .footing import root_turns, sole_poses
from .footwork import FootPlan
from .legs import foot_signs, nominal_feet
from .robot_clip import RATE
from .splines import rest_spline

LEAST = 0.1  # [s] from lift-off to touchdown, and on both feet
STANDING = 1.3  # [s] of standing that it takes to shift the weight to one foot, and back


@dataclass(frozen=True)
class Waypoint:
    """A place of a foot at a time, from where it is in standing; lengths in h, angles in °."""

    time: float = field(metadata={"min": 0.0})  # [s]
    ahead: float = 0.0
    left: float = 0.0
    up: float = field(default=0.0, metadata={"min": 0.0})
    pitch: float = 0.0  # of the toes, down


@dataclass(frozen=True)
class FootStep:
    """A swing from `lift` to `land`, through `way`, to `ahead` and `left` of standing."""

    foot: Literal["left", "right"]
    lift: float = field(metadata={"min": 0.0})  # [s]
    land: float = field(metadata={"min": 0.0})  # [s]
    way: tuple[Waypoint, ...] = ()
    ahead: float = 0.0  # [h] where it lands
    left: float = 0.0  # [h]

    def __post_init__(self) -> None:
        times = [self.lift, *(point.time for point in self.way), self.land]
        if any(b - a < LEAST / 2 for a, b in pairwise(times)) or self.land - self.lift < LEAST:
            raise ValueError(f"way: times must rise from lift to land by {LEAST / 2} s, {times}")


def check_steps(steps: Sequence[FootStep], duration: float) -> None:
    """Raise ValueError unless one foot at a time swings, and both stand at the end."""
    times = [t for step in steps for t in (step.lift, step.land)]
    if any(b - a < LEAST for a, b in pairwise(times)):
        raise ValueError(f"steps: one after the other, with {LEAST} s between, not {times}")
    if min(times[0], duration - times[-1]) < STANDING - 1e-9:
        raise ValueError(f"steps: {STANDING} s of standing are needed before the first and after "
                         f"the last, not {times[0]:g} and {duration - times[-1]:g}")  # fmt: skip


def plan_steps(
    steps: Sequence[FootStep], joints: np.ndarray, root: np.ndarray, robot: Robot, source: str
) -> FootPlan:
    """The plan of a motion with these steps, whose CoM is as high as in standing.

    Args:
        steps: in order.
        joints: (F, nj) at `RATE` [rad]; root: (F, 3) φ of the root from standing [rad].
        robot: with two feet.
        source: for errors.
    """
    if len(robot.soles) != 2:
        raise ConfigError(f"robot {robot.name!r} has not two feet", source=source, field="steps")
    frames, h = len(joints), robot.height_com
    times = np.arange(frames) * RATE
    nominal = nominal_feet(robot) * [1.0, 1.0, 0.0]
    places = np.repeat(nominal[None], frames, axis=0)
    turns, planted = np.zeros((frames, 2, 3)), np.ones((frames, 2), dtype=bool)
    left = int(np.argmax(foot_signs(robot)))
    for step in steps:
        foot = left if step.foot == "left" else 1 - left
        a, b = (round(t / RATE) for t in (step.lift, step.land))
        way = [Waypoint(step.lift), *step.way, Waypoint(step.land, step.ahead, step.left)]
        points = np.array([[p.ahead * h, p.left * h, p.up * h, np.radians(p.pitch)] for p in way])
        points[:, :3] += nominal[foot]
        points[0, :3] = places[a, foot]
        curve = rest_spline(np.array([a * RATE, *(p.time for p in step.way), b * RATE]), points)
        values = curve(times[a : b + 1])
        places[a : b + 1, foot], turns[a : b + 1, foot, 1] = values[:, :3], values[:, 3]
        places[b:, foot] = points[-1, :3]
        planted[a + 1 : b, foot] = False
    return FootPlan(RATE, joints, root, np.full(frames, h), places, turns, planted)


def plan_of(robot: Robot, qpos: np.ndarray, dt: float, planted: np.ndarray) -> FootPlan:
    """What postures (F, nq) with `planted` soles (F, 2) ask of a robot, but for where their CoM and
    its legs go."""
    com, places, turns = sole_poses(robot, qpos)
    return FootPlan(dt, qpos[:, 7:], root_turns(robot, qpos), com[:, 2], places, turns, planted)
