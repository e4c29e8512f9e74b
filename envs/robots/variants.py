"""A robot that differs from the described one: another friction, other masses, longer steps."""

from __future__ import annotations

import copy
from dataclasses import replace

import mujoco

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


def perturbed_robot(
    robot: Robot, *, friction: float | None = None, mass_error: float = 0.0
) -> Robot:
    """A copy of `robot` with another sliding friction, and masses scaled by 1 + `mass_error`.

    Inertias scale with the masses. Postures, sizes and motors stay, so that a controller made for
    `robot` fits. The copy serves to be simulated; `robot` is not changed.

    Args:
        friction: sliding coefficient of every geom and contact pair; None: as it is.
        mass_error: −0.1 makes every body a tenth lighter.

    Raises ValueError for a friction that is not positive or masses that would not be.
    """
    if friction is not None and not friction > 0.0:
        raise ValueError(f"friction must be positive, not {friction}")
    if not mass_error > -1.0:
        raise ValueError(f"mass_error must be above -1, not {mass_error}")
    model = copy.copy(robot.model)
    if friction is not None:
        model.geom_friction[:, 0] = friction
        model.pair_friction[:, :2] = friction
    if mass_error != 0.0:
        model.body_mass *= 1.0 + mass_error
        model.body_inertia *= 1.0 + mass_error
        mujoco.mj_setConst(model, mujoco.MjData(model))  # what derives from masses
    return replace(
        robot,
        model=model,
        mass=float(model.body_subtreemass[robot.root_body_id]),
        fingerprint=fingerprint(model, robot.standing_qpos),
    )
