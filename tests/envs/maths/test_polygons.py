"""Convex hulls: `envs/maths/polygons.py`."""

import numpy as np

from poise.envs.maths.polygons import convex_hull


def test_hull_of_points():
    """Corners of a polygon in order; no point inside, on an edge, or twice."""
    rng = np.random.default_rng(2)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
    polygon = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    edges = 0.3 * polygon + 0.7 * np.roll(polygon, 1, axis=0)
    inside = polygon.mean(axis=0) + 0.1 * rng.normal(size=(20, 2))
    points = rng.permutation(np.vstack([polygon, polygon[::2], edges, inside]))
    out = np.zeros((2 * len(points) + 1, 2))
    found = out[: convex_hull(points.copy(), len(points), 1e-12, out)]
    start = int(np.argmin(polygon[:, 0]))
    np.testing.assert_array_equal(found, np.roll(polygon, -start, axis=0))
