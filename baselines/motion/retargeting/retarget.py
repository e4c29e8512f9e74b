"""A clip of any skeleton as a motion of a robot: its soles stay planted, or step as the clip's."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from poise.baselines.balance.references.footwork import perform_plan
from poise.baselines.balance.references.robot_clip import RATE, About, RobotClip
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.configs.errors import ConfigError
from poise.configs.extras import how_to_install
from poise.envs.robots.robot import Robot

from .limbs import Limbs, find_limbs
from .paces import LONGEST, clip_heading, frames_before, longest_step, plan_paces
from .targets import BodyTargets, between_standing, clip_targets, standing_targets

SMOOTH = 3.0  # [Hz] of the low-pass on what the clip asks for, and on the joints
LEAD = 1.0  # [s] from standing into the clip, and back
SHORTER, SHORTEST = 0.94, 0.3  # by which steps are shortened until legs reach, and the end of that


class Retargeted(NamedTuple):
    """The robot's clip and how well it met what was asked.

    Attributes:
        clip: the postures, from standing to standing.
        scale: the robot's legs over the clip's.
        sole_error, direction_error, penetration, time_per_frame: as in `Solved`.
        limit_excess: largest excess over a joint limit [rad]; 0 if there is none.
        stride: by which steps are shorter than the legs' scale has them; 1 without steps.
        begins: when the clip begins in the motion [s].
    """

    clip: RobotClip
    scale: float
    sole_error: float
    direction_error: dict[str, float]
    penetration: float
    time_per_frame: float
    limit_excess: float
    stride: float = 1.0
    begins: float = LEAD


def retarget(
    clip: Clip, robot: Robot, *, smooth: float = SMOOTH, lead: float = LEAD, planted: bool = False
) -> Retargeted:
    """The postures in which a robot does what a clip shows, its soles planted where the clip's are.

    Per frame: directions of pelvis, trunk, shoulders and arms as in the clip; the hips' height in
    proportion to the legs; the CoM over its place; the soles fixed; the joints within their limits;
    links off the floor and off each other. Where the clip's feet move by 12 cm, trunk and arms are
    those, the feet step as in `paces.py`, and the CoM goes where they can bear it.

    Args:
        clip: whose hips, knees, ankles, shoulders, elbows and wrists are known by name.
        robot: with two feet; without arms their part is left out.
        smooth: low-pass [Hz].
        lead: time from standing into the clip, and back [s].
        planted: take the feet as planted though they move in the clip.

    Raises:
        ConfigError: feet that jump or turn, or steps that the legs cannot do (without `planted`);
            unknown joints, fewer than 8 frames, a `smooth` or `lead` that is not above 0, mink is
            missing.
        PoiseError: no posture keeps the soles and the limits.
    """
    asked = targets_on(clip, robot, smooth=smooth, lead=lead, planted=planted)
    return retarget_to(asked, clip, robot, smooth=smooth, lead=lead)


class AskedOf(NamedTuple):
    """What a clip asks of a robot.

    Attributes:
        limbs: the robot's.
        targets: from standing to standing.
        heading: of a clip with steps [rad]; None for feet that stay.
    """

    limbs: Limbs
    targets: BodyTargets
    heading: float | None


def retarget_to(
    asked: AskedOf, clip: Clip, robot: Robot, *, smooth: float, lead: float
) -> Retargeted:
    """`retarget` for what `targets_on` has found with the same arguments; raises what it does."""
    limbs, whole, heading = asked
    solved = _solver()(robot, limbs, whole, smooth)
    about = About(robot.name, robot.fingerprint, clip.name, clip.name, clip.licence)
    qpos, stance, stride, begins = solved.qpos, None, 1.0, lead
    if heading is not None:
        walk = clip.resampled(RATE).turned(-heading)
        qpos, stance, stride = _stepped(walk, robot, limbs, qpos, lead)
        begins = RATE * frames_before(walk, max(round(lead / RATE), 1))
    joints = qpos[:, 7:]
    excess = np.maximum(robot.joint_range[:, 0] - joints, joints - robot.joint_range[:, 1])
    return Retargeted(
        RobotClip(about, RATE, qpos, stance),
        limbs.leg_length / clip.skeleton.leg_length,
        solved.sole_error,
        solved.direction_error,
        solved.penetration,
        solved.time_per_frame,
        float(max(excess.max(), 0.0)),
        stride,
        begins,
    )


def targets_on(clip: Clip, robot: Robot, *, smooth: float, lead: float, planted: bool) -> AskedOf:
    """What a clip asks of a robot; arguments and errors as of `retarget`."""
    for name, value in (("smooth", smooth), ("lead", lead)):
        if not 0.0 < value <= 100.0:
            raise ConfigError(f"must be above 0 and at most 100, not {value:g}", field=name)
    steps = not planted and not measure_contacts(clip).in_place
    limbs = find_limbs(robot)
    heading = clip_heading(clip) if steps else None
    targets = clip_targets(clip, limbs.has_arms, smooth, heading)
    whole = between_standing(targets, standing_targets(robot, limbs), lead)
    return AskedOf(limbs, whole, heading)


def _stepped(
    clip: Clip, robot: Robot, limbs: Limbs, qpos: np.ndarray, lead: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Postures with the steps of a clip along x, the planted soles, and what is left of their
    lengths: less until the legs reach."""
    scale, frames = limbs.leg_length / clip.skeleton.leg_length, max(round(lead / RATE), 1)
    stride = min(LONGEST * robot.height_com / max(longest_step(clip, scale), 1e-6), 1.0)
    while True:
        plan = plan_paces(clip, robot, qpos, frames, scale, stride)
        try:
            return perform_plan(robot, plan, clip.name), plan.planted, stride
        except ConfigError:
            stride *= SHORTER
            if stride < SHORTEST:
                raise


def _solver() -> Any:  # the function `solve_frames`
    try:
        from .solve import solve_frames
    except ImportError as error:
        raise ConfigError(f"needs the package {error.name}: {how_to_install('motion')}",
                          source="motion") from None  # fmt: skip
    return solve_frames
