"""Interpolation of keyframes: through the values, C², at rest at the ends; the compiled table."""

import numpy as np
import pytest
from scipy.interpolate import PPoly

from poise.baselines.balance.references.splines import evaluate, piecewise, rest_spline

TIMES = np.array([0.0, 0.7, 1.0, 2.5, 3.0])
VALUES = np.array([[0.0, 1.0], [2.0, -1.0], [1.0, 0.5], [-1.0, 0.0], [0.0, 1.0]])


@pytest.fixture(scope="module")
def table():
    other = np.linspace(0.0, 3.0, 11)
    return piecewise([rest_spline(TIMES, VALUES), rest_spline(other, np.sin(other)[:, None])])


def at(table, t, loop=False):
    out = np.zeros((3, 3))
    evaluate(*table, loop, t, *out)
    return out


@pytest.mark.parametrize("n", [2, 3, 5])
def test_rest_spline_meets_values_and_rests_at_the_ends(n):
    """Values at the keyframes; velocity and acceleration zero at both ends, jerk not."""
    spline = rest_spline(TIMES[:n], VALUES[:n])
    np.testing.assert_allclose(spline(TIMES[:n]), VALUES[:n], atol=1e-12)
    for order in (1, 2):
        np.testing.assert_allclose(spline(TIMES[[0, n - 1]], order), 0.0, atol=1e-9)
    assert np.abs(spline(TIMES[0], 3)).min() > 0.1


def test_table_matches_scipy(table):
    """The compiled evaluation equals SciPy's of the same coefficients and of the spline."""
    knots, coeffs = table
    poly = PPoly(np.moveaxis(coeffs[:, ::-1], 0, 1), knots)
    spline = rest_spline(TIMES, VALUES)
    for t in np.random.default_rng(0).uniform(0.0, 3.0, 50):
        out = at(table, t)
        for order in range(3):
            np.testing.assert_allclose(out[order], poly(t, nu=order), atol=1e-9)
            np.testing.assert_allclose(out[order, :2], spline(t, order), atol=1e-9)


def test_velocity_and_acceleration_are_derivatives(table):
    """Central differences of position and velocity, also across knots."""
    h = 1e-5
    for t in [*np.random.default_rng(1).uniform(0.01, 2.99, 30), 0.7, 1.0]:
        before, now, after = at(table, t - h), at(table, t), at(table, t + h)
        np.testing.assert_allclose((after[0] - before[0]) / (2 * h), now[1], atol=1e-6)
        np.testing.assert_allclose((after[1] - before[1]) / (2 * h), now[2], rtol=1e-3, atol=1e-3)


def test_table_is_twice_continuous_everywhere(table):
    """Nothing jumps at a knot, at the held ends, or where a loop repeats."""
    eps = 1e-9
    for knot in table[0]:
        np.testing.assert_allclose(at(table, knot - eps), at(table, knot + eps), atol=1e-6)
    np.testing.assert_allclose(
        at(table, 3.0 - eps, True)[:, :2], at(table, 3.0 + eps, True)[:, :2], atol=1e-6
    )


def test_ends_are_held_or_repeated(table):
    """Before and after the span the end values stand still; a loop starts again."""
    for t, value in [(-1.0, at(table, 0.0)), (9.0, at(table, 3.0))]:
        np.testing.assert_allclose(at(table, t)[0], value[0], atol=1e-12)
        assert not at(table, t)[1:].any()
    np.testing.assert_allclose(at(table, 3.0 * 7 + 0.8, True), at(table, 0.8), atol=1e-9)
    np.testing.assert_allclose(at(table, -3.0 + 0.8, True), at(table, 0.8), atol=1e-9)


def test_only_the_columns_asked_for_are_written(table):
    """Shorter outputs get the first columns."""
    out = np.zeros((3, 2))
    evaluate(*table, False, 1.3, *out)
    np.testing.assert_array_equal(out, at(table, 1.3)[:, :2])
