"""A walked clip begins when a planner's step and its own come together."""

import math
from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.reference_motion import SHIFT, WalkCommand, whole_walk
from poise.baselines.balance.references.robot_clip import RobotClip
from poise.envs.robots.robot import Robot

FIRST_STEP = 1.5  # swings from a command to the first touchdown: the weight shifts before
BOTH = 0.13  # [1/ω] on both feet between two swings of packaged gaits
EARLY = 0.005  # [s] by which a step is shorter than these together: a sole touches early


def in_step(clip: RobotClip, robot: Robot) -> RobotClip:
    """A clip that is walked by `commands`, its first posture held while the planner takes up to two
    steps more, so that the first foot that lands in it lands with the robot's.

    The same clip where no foot is known to land, or where its commands leave the time of a step to
    the gait, which is not known here.
    """
    if clip.commands is None or clip.planted is None:
        return clip
    lands = np.argwhere(clip.planted[1:] & ~clip.planted[:-1])
    row = WalkCommand(*clip.commands[0].tolist())
    swing = float(row.step_time)
    if not len(lands) or swing <= 0.0:
        return clip
    _, commands = whole_walk(robot, clip.qpos, clip.dt, clip.commands)
    wanted = float(WalkCommand(*commands[1]).start) + float(lands[0, 0] + 1) * clip.dt
    first, period = SHIFT + FIRST_STEP * swing, swing + BOTH / robot.omega - EARLY
    steps = max(math.ceil((wanted - first) / period), 0)
    begins = 0 if float(row.left) > 0.0 else 1  # the foot of the side that it goes to, or the right
    steps += (steps + begins + int(lands[0, 1])) % 2
    frames = round((first + steps * period - wanted) / clip.dt)
    if frames <= 0:
        return clip
    later = clip.commands.copy()
    np.asarray(WalkCommand(*later.T).start)[1:] += frames * clip.dt
    qpos, planted = (np.concatenate([np.repeat(values[:1], frames, axis=0), values])
                     for values in (clip.qpos, clip.planted))  # fmt: skip
    return replace(clip, qpos=qpos, planted=planted, commands=later)
