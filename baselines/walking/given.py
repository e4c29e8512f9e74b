"""Which footholds a terrain gives, and whether a robot can step on them."""

from itertools import pairwise

import numpy as np

from poise.baselines.balance.stepping.planning.units import in_si
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.robots.robot import Robot
from poise.envs.terrain.arrays import surface_arrays
from poise.envs.terrain.terrain import Surface, Terrain

from .config import TreadConfig
from .planner.blocks import Treads
from .planner.treads import FREE, LEVEL

STEEPEST = 10.0  # [°] of ground that is walked on as if it were level


def given_footholds(terrain: Terrain, robot: Robot, config: TreadConfig) -> list[Surface]:
    """Return the surfaces on which a planner steps that assumes this terrain; none: all is free.

    Raises ConfigError with the limits of this robot for one that cannot be stepped: treads shorter
    than its soles, steps that are too high or too far, slopes that are too steep.
    """
    surfaces = terrain.assumed()
    for surface in surfaces:
        angle = float(np.degrees(np.arctan(surface.gradient)))
        if abs(angle) > STEEPEST:
            raise _cannot(terrain, f"a slope of {angle:.3g}°", robot,
                          f"walks on up to {STEEPEST:.3g}°")  # fmt: skip
    long = all(_length(surface) > FREE for surface in surfaces)
    if long and all(_meet(before, after) for before, after in pairwise(surfaces)):
        return []
    for before, after in pairwise(surfaces):
        _check_step(before, after, terrain, robot, config)
    return surfaces


def _check_step(
    before: Surface, after: Surface, terrain: Terrain, robot: Robot, config: TreadConfig
) -> None:
    h = robot.height_com
    sole = max(float(np.ptp(each.polygon[:, 0])) for each in robot.soles)
    least, highest, longest = sole + 2.0 * config.margin * h, config.highest * h, config.longest * h
    rise = after.height - before.height
    way = min(_length(before), _length(after), after.middle[0] - before.middle[0])
    way = after.x_min - before.x_max + least if _length(after) > FREE else way
    if _length(after) < least:
        raise _cannot(terrain, f"a tread of {_length(after):.3g} m", robot,
                      f"needs {least:.3g} m: its sole is {sole:.3g} m long")  # fmt: skip
    if abs(rise) > highest:
        raise _cannot(terrain, f"a step of {rise:.3g} m", robot,
                      f"steps up and down by at most {highest:.3g} m")  # fmt: skip
    if max(way, after.x_min - before.x_max + least) > longest:
        raise _cannot(terrain, f"a step of {max(way, after.x_min - before.x_max + least):.3g} m to "
                      "the next surface", robot, f"steps at most {longest:.3g} m far")  # fmt: skip


def _cannot(terrain: Terrain, what: str, robot: Robot, limit: str) -> ConfigError:
    kind = type(terrain).__name__.lower()
    return ConfigError(f"{what} cannot be stepped: {robot.name!r} {limit}", source=kind,
                       field="terrain")  # fmt: skip


def _meet(before: Surface, after: Surface) -> bool:
    """Whether one goes on where the other ends, without an edge between them."""
    ends = [
        surface.height + surface.gradient * (x - surface.middle[0])
        for surface, x in ((before, before.x_max), (after, after.x_min))
    ]
    return bool(after.x_min == before.x_max and abs(ends[0] - ends[1]) < LEVEL)


def _length(surface: Surface) -> float:
    return surface.x_max - surface.x_min


def allocate_treads(config: TreadConfig, surfaces: list[Surface], units: Units) -> Treads:
    """The block of the surfaces on which steps are given."""
    numbers = in_si(
        config, units, "clearance", "margin", "least_step", "approach", "highest", "hold_up",
        "hold_down", "rise", "rise_down", "lower", "lower_down", "arrive", "lean", "lean_from",
    )  # fmt: skip
    return Treads.allocate(
        **numbers,
        surfaces=surface_arrays(surfaces),
    )
