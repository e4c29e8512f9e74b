"""Terrain for compiled code."""

from collections.abc import Sequence

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros

from .terrain import Surface

SURFACE = np.dtype([(name, float) for name in Surface._fields], align=True)
NOWHERE = -1  # number of the floor among the surfaces


def surface_arrays(surfaces: Sequence[Surface]) -> np.ndarray:
    """(n,) surfaces as compiled code reads them, by the names of the fields of `Surface`."""
    rows = guarded_zeros(len(surfaces), SURFACE)
    for i, surface in enumerate(surfaces):
        rows[i] = tuple(surface)
    return rows


@compiled
def surface_height(surfaces: np.ndarray, i: int, floor: float, x: float) -> float:
    """The height at x of the plane of surface `i`; the `floor` for `NOWHERE` [m]."""
    if i < 0:
        return floor
    s = surfaces[i]
    return s.height + s.gradient * (x - 0.5 * (s.x_min + s.x_max))


@compiled
def surface_below(surfaces: np.ndarray, x: float, y: float) -> int:
    """The highest of the surfaces at (x, y), or `NOWHERE`."""
    found, highest = NOWHERE, -np.inf
    for i in range(surfaces.shape[0]):
        s = surfaces[i]
        if x < s.x_min or x > s.x_max or y < s.y_min or y > s.y_max:
            continue
        z = surface_height(surfaces, i, 0.0, x)
        if z > highest:
            found, highest = i, z
    return found


@compiled
def ground_height(surfaces: np.ndarray, floor: float, x: float, y: float) -> float:
    """The height of the ground at (x, y) [m], as `Terrain.height`."""
    return surface_height(surfaces, surface_below(surfaces, x, y), floor, x)
