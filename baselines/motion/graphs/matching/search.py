"""The exact nearest of many points, compiled."""

from __future__ import annotations

import numpy as np

from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.jit import compiled

BOX = 16  # points in a box: of a motion, half a second


class NearestPoint(Copyable):
    """Points (N, n) in an order in which neighbours are near, as those of a motion are.

    They are turned to their principal axes, which changes no distance but lets the first few
    columns tell most of it. Boxes around 16 points that are further away than the nearest point so
    far are left out, and a sum of squares is given up once it exceeds the least. [Clavet16]
    """

    def __init__(self, points: np.ndarray):
        self.mean = points.mean(axis=0)
        self.axes = np.linalg.svd(points - self.mean, full_matrices=False)[2].T
        if self.axes.shape[1] < points.shape[1]:  # fewer points than columns span no basis
            self.axes = np.eye(points.shape[1])
        self.points = np.ascontiguousarray((points - self.mean) @ self.axes)
        begins = np.arange(0, len(points), BOX)
        self.low = np.minimum.reduceat(self.points, begins)
        self.high = np.maximum.reduceat(self.points, begins)

    def find(self, query: np.ndarray) -> tuple[int, float]:
        """The number of the point nearest to `query` (n,), the first of equal ones, and how far it
        is."""
        turned = (query - self.mean) @ self.axes
        found, square = find_nearest_point(self.points, self.low, self.high, turned)
        return found, float(np.sqrt(square))


@compiled
def find_nearest_point(
    points: np.ndarray, low: np.ndarray, high: np.ndarray, query: np.ndarray
) -> tuple[int, float]:
    """Row of `points` (N, n) nearest to `query` (n,) and its squared distance; `low` and `high`
    (boxes, n) are the corners of the boxes around every 16 rows."""
    count, size = points.shape
    bounds = np.empty(low.shape[0])
    for box in range(low.shape[0]):
        bounds[box] = 0.0
        for j in range(size):
            gap = max(low[box, j] - query[j], 0.0) + max(query[j] - high[box, j], 0.0)
            bounds[box] += gap * gap
    best = int(np.argmin(bounds))
    least, nearest = np.inf, -1
    for k in range(-1, low.shape[0]):  # the most promising box comes first
        box = best if k < 0 else k
        if bounds[box] > least or k == best:
            continue
        for i in range(BOX * box, min(BOX * (box + 1), count)):
            square = 0.0
            for j in range(size):
                gap = points[i, j] - query[j]
                square += gap * gap
                if j % 4 == 3 and square > least:
                    break
            if square < least or (square == least and i < nearest):
                least, nearest = square, i
    return nearest, least
