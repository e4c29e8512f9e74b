"""A robot that differs from the described one: longer steps of its physics."""

import copy
from dataclasses import replace

from .robot import Robot, fingerprint


def coarser_robot(robot: Robot, timestep: float) -> Robot:
    """A copy of `robot` that is simulated in physics steps of `timestep` [s]; all else is alike.

    Raises ValueError for a step that is not in (0, 0.01].
    """
    if not 0.0 < timestep <= 0.01:
        raise ValueError(f"timestep must be above 0 and at most 0.01 s, not {timestep}")
    model = copy.copy(robot.model)
    model.opt.timestep = timestep
    return replace(robot, model=model, fingerprint=fingerprint(model, robot.standing_qpos))
