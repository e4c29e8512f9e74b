"""Terrain for compiled code."""

from collections.abc import Sequence

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros

from .terrain import Surface

X_MIN, X_MAX, Y_MIN, Y_MAX, HEIGHT, GRADIENT = range(6)
NOWHERE = -1  # number of the floor among the surfaces


def surface_arrays(surfaces: Sequence[Surface]) -> np.ndarray:
    """(n, 6) one row for each surface, its entries in their order."""
    rows = guarded_zeros((len(surfaces), len(Surface._fields)))
    for i, surface in enumerate(surfaces):
        rows[i] = surface
    return rows


@compiled
def surface_height(surfaces: np.ndarray, i: int, floor: float, x: float) -> float:
    """The height at x of the plane of surface `i`; the `floor` for `NOWHERE` [m]."""
    if i < 0:
        return floor
    s = surfaces[i]
    return s[HEIGHT] + s[GRADIENT] * (x - 0.5 * (s[X_MIN] + s[X_MAX]))


@compiled
def surface_below(surfaces: np.ndarray, x: float, y: float) -> int:
    """The highest of the surfaces at (x, y), or `NOWHERE`."""
    found, highest = NOWHERE, -np.inf
    for i in range(surfaces.shape[0]):
        s = surfaces[i]
        if x < s[X_MIN] or x > s[X_MAX] or y < s[Y_MIN] or y > s[Y_MAX]:
            continue
        z = surface_height(surfaces, i, 0.0, x)
        if z > highest:
            found, highest = i, z
    return found


@compiled
def ground_height(surfaces: np.ndarray, floor: float, x: float, y: float) -> float:
    """The height of the ground at (x, y) [m], as `Terrain.height`."""
    return surface_height(surfaces, surface_below(surfaces, x, y), floor, x)
