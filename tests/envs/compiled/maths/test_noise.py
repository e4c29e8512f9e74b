"""envs/compiled/maths/noise.py: the distribution of what compiled code draws.

A mean of n numbers of deviation s is off by more than 5 s/√n once in two million seeds.
"""

import numpy as np
import pytest

from poise.envs.compiled.maths.noise import add_noise, normal, uniform

COUNT, SIGMAS = 20_000, 5.0


def state(seed: int = 1) -> np.ndarray:
    return np.array([seed], dtype=np.uint64)


def near(values: np.ndarray, mean: float, variance: float) -> bool:
    return bool(abs(values.mean() - mean) < SIGMAS * np.sqrt(variance / len(values)))


def test_uniform_numbers_are_uniform():
    """Moments, and counts in 16 bins by χ² (15 ± 5.5, and 60 is beyond 1e-6); neighbours apart."""
    s = state()
    u = np.array([uniform(s) for _ in range(COUNT)])
    assert 0.0 <= u.min() and u.max() < 1.0
    assert near(u, 0.5, 1 / 12) and near(u**2, 1 / 3, 4 / 45)
    assert near((u[1:] - 0.5) * (u[:-1] - 0.5), 0.0, 1 / 144)
    counts = np.histogram(u, 16, (0.0, 1.0))[0]
    assert np.sum((counts - COUNT / 16) ** 2) / (COUNT / 16) < 60.0


@pytest.mark.parametrize("odd", [2, 3])
def test_noise_is_normal(odd):
    """Four moments of entries in pairs and of one left over; entries of a vector are apart."""
    s, deviation = state(2), 0.3
    vectors = np.zeros((COUNT // 2, odd))
    for vector in vectors:
        add_noise(s, deviation, vector)
    z = vectors / deviation
    for column in z.T:
        moments = (0.0, 1.0), (1.0, 2.0), (0.0, 15.0), (3.0, 96.0)
        for power, (mean, variance) in enumerate(moments, 1):
            assert near(column**power, mean, variance), power
    assert near(z[:, 0] * z[:, 1], 0.0, 1.0) and near(z[:, 0] * z[:, -1], 0.0, 1.0)
    ones = np.array([normal(s) for _ in range(COUNT)])
    assert near(ones, 0.0, 1.0) and near(ones**2, 1.0, 2.0)


def test_noise_is_added_and_repeats():
    """A seed gives its numbers again; without deviation nothing is drawn."""
    first, second, base = np.ones(5), np.ones(5), state(7)
    add_noise(state(7), 0.1, first)
    add_noise(base, 0.1, second)
    assert np.array_equal(first, second) and not np.array_equal(first, np.ones(5))
    moved = base.copy()
    add_noise(base, 0.0, second)
    assert np.array_equal(moved, base) and np.array_equal(first, second)
