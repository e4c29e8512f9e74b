"""Convex hulls: `envs/compiled/maths/polygons.py`."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from poise.envs.compiled.maths.polygons import convex_hull

LINE = 1e-12  # [m]


def hull(points: np.ndarray) -> np.ndarray:
    """The corners (k, 2) of the hull of `points` (n, 2)."""
    out = np.zeros((2 * len(points) + 1, 2))
    return out[: convex_hull(points.copy(), len(points), LINE, out)]


def test_hull_of_points():
    """Corners of a polygon in order; no point inside, on an edge, or twice."""
    rng = np.random.default_rng(2)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
    polygon = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    edges = 0.3 * polygon + 0.7 * np.roll(polygon, 1, axis=0)
    inside = polygon.mean(axis=0) + 0.1 * rng.normal(size=(20, 2))
    points = rng.permutation(np.vstack([polygon, polygon[::2], edges, inside]))
    start = int(np.argmin(polygon[:, 0]))
    np.testing.assert_array_equal(hull(points), np.roll(polygon, -start, axis=0))


def rectangle(size: tuple[float, float], along: list[float], angle: float) -> np.ndarray:
    """A turned rectangle's corners, then points on its edges, as fractions `along` each of them."""
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * size / 2.0
    ahead = np.roll(corners, -1, axis=0)
    points = np.vstack([corners, *((1.0 - t) * corners + t * ahead for t in along)])
    cos, sin = np.cos(angle), np.sin(angle)
    return points @ np.array([[cos, sin], [-sin, cos]])


LENGTHS = st.floats(0.02, 1.0)
QUARTERS = st.sampled_from([0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi])
SMALL = st.sampled_from([0.0, *(s * 10.0**k for k in range(-18, -11) for s in (-1.0, 1.0))])


@given(
    st.tuples(LENGTHS, LENGTHS), st.lists(st.floats(0.1, 0.9), max_size=3),
    QUARTERS, SMALL, st.floats(-18.0, -13.0), st.integers(0, 2**32),
)  # fmt: skip
def test_hull_of_upright_edges_that_rounding_bends(size, along, quarter, turn, noise, seed):
    """The corners of a rectangle and no others, wherever rounding puts them and its edges' points.

    Points of an upright edge whose x differ by rounding are sorted in any order of their y."""
    rng = np.random.default_rng(seed)
    points = rectangle(size, along, quarter + turn)
    corners, noise = points[:4], 10.0**noise
    points = np.vstack([points, corners]) + rng.uniform(-noise, noise, (len(points) + 4, 2))
    found = hull(rng.permutation(points))
    assert len(found) == 4
    gaps = np.linalg.norm(found[:, None] - corners, axis=2)
    assert gaps.min(axis=0).max() < LINE and gaps.min(axis=1).max() < LINE
    ahead = np.roll(found, -1, axis=0)
    area = 0.5 * np.sum(found[:, 0] * ahead[:, 1] - found[:, 1] * ahead[:, 0])
    np.testing.assert_allclose(area, ConvexHull(points).volume, rtol=1e-9)
