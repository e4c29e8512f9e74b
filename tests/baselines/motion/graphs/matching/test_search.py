"""The nearest point is that of a search of all of them."""

import numpy as np
import pytest

from poise.baselines.motion.graphs.matching.search import BOX, NearestPoint

RNG = np.random.default_rng(0)


def brute_force(points: np.ndarray, query: np.ndarray) -> tuple[int, float]:
    distances = np.linalg.norm(points - query, axis=1)
    return int(np.argmin(distances)), float(distances.min())


@pytest.mark.parametrize("size", [1, 3, 4, 11, 38])
@pytest.mark.parametrize("count", [1, 2, BOX, BOX + 1, 500])
def test_nearest_is_that_of_brute_force(count: int, size: int) -> None:
    """Of points without and with an order; queries near to, far from and at the points."""
    scattered = RNG.normal(size=(count, size))
    for points in (scattered, np.cumsum(scattered, axis=0)):
        search = NearestPoint(points)
        for query in [*(points[RNG.integers(count, size=10)] + 0.3 * RNG.normal(size=(10, size))),
                      *(5.0 * RNG.normal(size=(10, size))), points[-1]]:  # fmt: skip
            found, distance = search.find(query)
            wanted, least = brute_force(points, query)
            assert found == wanted and distance == pytest.approx(least, abs=1e-9)


def test_of_equal_points_the_first_is_found() -> None:
    points = np.repeat(RNG.normal(size=(3, 5)), 20, axis=0)
    search = NearestPoint(points)
    assert [search.find(points[i])[0] for i in (0, 19, 20, 45)] == [0, 0, 20, 40]
