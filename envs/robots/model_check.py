"""Models that MuJoCo takes and no simulation can use: endless, or with numbers that are none."""

from __future__ import annotations

import mujoco
import numpy as np

from poise.configs.errors import ConfigError

LARGEST = 1e9  # of a number that the motion depends on, SI units
MOST_ITERATIONS = 1000  # of a solver, in a physics step
ITERATIONS = ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations",
              "sdf_iterations", "sdf_initpoints")  # fmt: skip


def check_numbers(model: mujoco.MjModel, dynamics: tuple[str, ...], source: str) -> None:
    """Raise ConfigError for numbers of the model that are not finite, and for options that no
    robot stands with: another gravity than down, endless iterations.

    Args:
        model: compiled.
        dynamics: names of the arrays that its motion depends on, which must not be huge either.
        source: the description file, for errors.
    """
    for name in (each for each in dir(model) if not each.startswith("_")):
        value = getattr(model, name)
        if isinstance(value, np.ndarray) and value.dtype.kind == "f":
            largest = LARGEST if name in dynamics else np.inf
            if not np.all(np.isfinite(value) & (np.abs(value) <= largest)):
                raise _wrong(f"{name} of the model must be finite and at most {LARGEST:g}", source)
    gravity = model.opt.gravity
    if not (np.all(gravity[:2] == 0.0) and 0.01 <= -gravity[2] <= 1000.0):
        raise _wrong(f"gravity must point down, 0.01 to 1000 m/s², not {gravity}", source)
    for name in ITERATIONS:
        if getattr(model.opt, name, 0) > MOST_ITERATIONS:
            raise _wrong(f"{name} must be at most {MOST_ITERATIONS}", source)


def check_standing(data: mujoco.MjData, root: int, source: str) -> None:
    """Raise ConfigError unless the centre of mass is above the ground in the standing posture."""
    height = data.subtree_com[root, 2]
    if not 0.0 < height < np.inf:
        raise ConfigError(
            f"the centre of mass would be at {height:g} m, not above the ground",
            source=source,
            field="posture",
        )


def _wrong(problem: str, source: str) -> ConfigError:
    return ConfigError(problem, source=source, field="source")
