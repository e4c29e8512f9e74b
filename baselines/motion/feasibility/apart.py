"""Joins of motions with steps: where both soles stand as in standing, wherever that is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import FEWEST, RobotClip, reference_from
from poise.baselines.balance.references.stances import (
    at_rest,
    carried,
    home_frames,
    home_place,
    place_of,
    why_not_home,
)
from poise.baselines.motion.clips.support import Support
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .trajectory import PlantedRobot


def stretch_at(
    robot: Robot, clip: RobotClip, frame: int, field: str
) -> tuple[ReferenceMotion, slice]:
    """The frames about one without a step between, and as a motion in place: what can be joined
    there. Of a clip without steps these are all.

    Raises ConfigError where a foot swings, or both do not stand as in standing for four frames.
    """
    name, time = clip.about.name, f"{frame * clip.dt:.2f} s"
    if clip.planted is None:
        return reference_from(clip, robot, name), slice(0, len(clip.qpos))
    if said := why_not_home(robot, clip.qpos[frame], clip.planted[frame]):
        raise ConfigError(f"at {time} {said}: no join is possible there", source=name, field=field)
    run = Support(clip.planted, home_frames(robot, clip.qpos, clip.planted)).run(frame)
    if run.stop - run.start < FEWEST:
        raise ConfigError(f"both soles stand for less than {FEWEST} frames at {time}",
                          source=name, field=field)  # fmt: skip
    placed = PlantedRobot(robot).placed
    qpos = np.array([placed(q[7:]) for q in clip.qpos[run]])
    return reference_from(RobotClip(clip.about, clip.dt, qpos), robot, name, rest=False), run


def check_rates(before: RobotClip, after: RobotClip) -> None:
    """Raise ConfigError for two clips, one with steps, at two rates."""
    steps = before.planted is not None or after.planted is not None
    if steps and abs(before.dt - after.dt) > 1e-9:
        raise ConfigError(f"has {1.0 / after.dt:.3g} frames a second, and {before.about.name!r} "
                          f"has {1.0 / before.dt:.3g}: with steps both must have as many",
                          source=after.about.name, field="dt")  # fmt: skip


def in_one(
    planted: PlantedRobot, before: RobotClip, after: RobotClip, between: Sequence[np.ndarray],
    name: str,
) -> RobotClip:  # fmt: skip
    """A, joints (n, nj) of a join, and B, of which one has steps, from where A's feet stand on.

    Raises PoiseError as `at_rest`.
    """
    robot = planted.robot
    joints = np.clip(np.vstack(between), *robot.joint_range.T)
    middle = np.array([planted.placed(q) for q in joints])
    here = place_of(robot, before.qpos[-1])
    qpos = np.vstack([before.qpos, carried(middle, home_place(robot), here),
                      carried(after.qpos, place_of(robot, after.qpos[0]), here)])  # fmt: skip
    contacts = [clip.planted if clip.planted is not None else np.ones((len(clip.qpos), 2), bool)
                for clip in (before, after)]  # fmt: skip
    contacts.insert(1, np.ones((len(middle), 2), dtype=bool))
    soles = np.concatenate(contacts)
    qpos = carried(qpos, place_of(robot, qpos[0]), home_place(robot))
    return RobotClip(
        replace(before.about, name=name), before.dt, at_rest(robot, qpos, soles), soles
    )
