"""A clip of any skeleton as a motion of a robot whose soles stay planted."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from poise.baselines.clips.clip import Clip
from poise.baselines.clips.contacts import IN_PLACE, measure_contacts
from poise.baselines.motions.robot_clip import About, RobotClip
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .limbs import Limbs, find_limbs
from .targets import RATE, BodyTargets, between_standing, clip_targets, standing_targets

SMOOTH = 3.0  # [Hz] of the low-pass on what the clip asks for, and on the joints
LEAD = 1.0  # [s] from standing into the clip, and back


class Retargeted(NamedTuple):
    """The robot's clip and how well it met what was asked.

    Attributes:
        clip: the postures, from standing to standing.
        scale: the robot's legs over the clip's.
        sole_error, direction_error, penetration, time_per_frame: as in `Solved`.
        limit_excess: largest excess over a joint limit [rad]; 0 if there is none.
    """

    clip: RobotClip
    scale: float
    sole_error: float
    direction_error: dict[str, float]
    penetration: float
    time_per_frame: float
    limit_excess: float


def retarget(
    clip: Clip, robot: Robot, *, smooth: float = SMOOTH, lead: float = LEAD, planted: bool = False
) -> Retargeted:
    """The postures in which a robot does what a clip shows, with both soles where it stands.

    Per frame: directions of pelvis, trunk, shoulders and arms as in the clip; the hips' height in
    proportion to the legs; the CoM over its place; the soles fixed; the joints within their limits;
    links off the floor and off each other.

    Args:
        clip: whose hips, knees, ankles, shoulders, elbows and wrists are known by name.
        robot: with two feet; without arms their part is left out.
        smooth: low-pass [Hz].
        lead: time from standing into the clip, and back [s].
        planted: take the feet as planted though they move in the clip.

    Raises:
        ConfigError: feet that move (without `planted`), unknown joints, fewer than 8 frames,
            a `smooth` or `lead` that is not above 0, mink is missing.
        PoiseError: no posture keeps the soles and the limits.
    """
    limbs, whole = targets_on(clip, robot, smooth=smooth, lead=lead, planted=planted)
    solved = _solver()(robot, limbs, whole, smooth)
    about = About(robot.name, robot.fingerprint, clip.name, clip.name, clip.licence)
    joints = solved.qpos[:, 7:]
    excess = np.maximum(robot.joint_range[:, 0] - joints, joints - robot.joint_range[:, 1])
    return Retargeted(
        RobotClip(about, RATE, solved.qpos),
        limbs.leg_length / clip.skeleton.leg_length,
        solved.sole_error,
        solved.direction_error,
        solved.penetration,
        solved.time_per_frame,
        float(max(excess.max(), 0.0)),
    )


def targets_on(
    clip: Clip, robot: Robot, *, smooth: float, lead: float, planted: bool
) -> tuple[Limbs, BodyTargets]:
    """The robot's limbs, and what a clip asks of it from standing to standing; see `retarget`."""
    for name, value in (("smooth", smooth), ("lead", lead)):
        if not 0.0 < value <= 100.0:
            raise ConfigError(f"must be above 0 and at most 100, not {value:g}", field=name)
    if not planted:
        _check_feet(clip)
    limbs = find_limbs(robot)
    targets = clip_targets(clip, limbs.has_arms, smooth)
    return limbs, between_standing(targets, standing_targets(robot, limbs), lead)


def _check_feet(clip: Clip) -> None:
    wander = float(measure_contacts(clip).wander.max())
    if wander >= IN_PLACE:
        raise ConfigError(
            f"its feet move by {100 * wander:.0f} cm: only clips whose feet stay can be followed "
            "yet (--planted takes them as planted)", source=clip.name, field="feet",
        )  # fmt: skip


def _solver() -> Any:  # the function `solve_frames`
    try:
        from .solve import solve_frames
    except ImportError as error:
        raise ConfigError(f"needs the package {error.name}: pip install 'poise[motion]'",
                          source="motion") from None  # fmt: skip
    return solve_frames
