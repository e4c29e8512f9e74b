"""Joins of motions with steps: between two of them, where both soles stand as in standing."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.baselines.motions.robot_clip import FEWEST, RobotClip, reference_from
from poise.baselines.motions.stances import (
    at_rest,
    away_from_home,
    carried,
    home_frames,
    home_place,
    place_of,
)
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .trajectory import PlantedRobot


class Stretch(NamedTuple):
    """The frames of a clip about a time without a step between, as a motion in place.

    Attributes:
        motion: of them.
        begin: time in the clip [s].
        end: of its last frame [s].
    """

    motion: ReferenceMotion
    begin: float
    end: float


def stretch_at(planted: PlantedRobot, clip: RobotClip, frame: int, field: str) -> Stretch:
    """What of a clip with steps can be joined at a frame.

    Raises ConfigError if a sole is in the air there, if the feet stand otherwise than in standing,
    and if they do not for four frames.
    """
    robot, name = planted.robot, clip.about.name
    assert clip.planted is not None
    home = home_frames(robot, clip.qpos, clip.planted)
    if not home[frame]:
        said = "a sole is in the air"
        if clip.planted[frame].all():
            gap, turned = away_from_home(robot, clip.qpos[frame : frame + 1])
            said = (f"the feet are {100.0 * gap[0]:.1f} cm and {np.degrees(turned[0]):.0f}° from "
                    "how they stand")  # fmt: skip
        raise ConfigError(f"at {frame * clip.dt:.2f} s {said}: no join is possible there",
                          source=name, field=field)  # fmt: skip
    run = Support(clip.planted, home).run(frame)
    if run.stop - run.start < FEWEST:
        raise ConfigError(f"both soles are planted for less than {FEWEST} frames at "
                          f"{frame * clip.dt:.2f} s", source=name, field=field)  # fmt: skip
    qpos = np.array([planted.placed(q[7:]) for q in clip.qpos[run]])
    motion = reference_from(RobotClip(clip.about, clip.dt, qpos), robot, name, rest=False)
    return Stretch(motion, run.start * clip.dt, (run.stop - 1) * clip.dt)
