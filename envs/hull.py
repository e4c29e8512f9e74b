"""Convex hulls in the ground plane."""

import numpy as np

from .jit import compiled


@compiled
def convex_hull(points: np.ndarray, n: int, line: float, out: np.ndarray) -> int:
    """The hull of the first `n` rows of `points` (≥ n, 2), counter-clockwise, into rows of `out`
    (≥ 2 n + 1, 2); how many they are.

    A corner nearer than `line` [m] to the line of its neighbours is none. Monotone chain; sorts
    `points` by x, then y.
    """
    for i in range(1, n):
        x, y = points[i, 0], points[i, 1]
        j = i - 1
        while j >= 0 and (points[j, 0] > x or (points[j, 0] == x and points[j, 1] > y)):
            points[j + 1, 0], points[j + 1, 1] = points[j, 0], points[j, 1]
            j -= 1
        points[j + 1, 0], points[j + 1, 1] = x, y
    size, least = 0, 2
    for k in range(2 * n - 1):
        if k == n:  # the lower chain is done, the upper one leads back
            least = size + 1
        i = k if k < n else 2 * n - 2 - k
        while size >= least and not _turns_left(out, size, line, points[i, 0], points[i, 1]):
            size -= 1
        out[size, 0], out[size, 1] = points[i, 0], points[i, 1]
        size += 1
    return size - 1


@compiled
def _turns_left(chain, size, line, x, y):
    """Whether the last corner of a chain lies to the right of the way to (x, y)."""
    ax, ay = chain[size - 2, 0], chain[size - 2, 1]
    bx, by = chain[size - 1, 0] - ax, chain[size - 1, 1] - ay
    dx, dy = x - ax, y - ay
    return bx * dy - by * dx > line * np.sqrt(dx * dx + dy * dy)
