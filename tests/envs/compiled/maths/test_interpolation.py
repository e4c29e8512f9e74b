"""Curves through keyframes by name: through the keys, as smooth as they say, and identities."""

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from poise.envs.compiled.maths.interpolation import FINE, KINDS, curve_through
from tests.support.refused import invalid

TIMES = np.array([0.0, 0.7, 1.0, 2.5, 3.0])
VALUES = np.array([[0.0, 1.0], [2.0, -1.0], [1.0, 0.5], [-1.0, 0.0], [0.0, 1.0]])
RATES = np.random.default_rng(0).normal(size=VALUES.shape)


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize("kind", KINDS)
def test_curves_go_through_the_keys(kind: str, count: int) -> None:
    curve = curve_through(kind, TIMES[:count], VALUES[:count])
    assert curve(TIMES[:count]) == pytest.approx(VALUES[:count], abs=1e-12)
    assert len(curve.c) <= 4  # cubic pieces


@pytest.mark.parametrize("kind", KINDS)
def test_curves_are_as_smooth_as_they_say(kind: str) -> None:
    """Derivatives up to that order have no jump at the keys inside; the next one has."""
    curve, inside = curve_through(kind, TIMES, VALUES), TIMES[1:-1]
    eps = 1e-9
    for order in range(4):
        jump = np.abs(curve(inside + eps, order) - curve(inside - eps, order))
        if order <= KINDS[kind]:
            tolerance = 1e-2 if kind == "polynomial" else 1e-5  # its pieces are cubic
            assert jump.max() < tolerance, order
        elif kind != "polynomial" and order == KINDS[kind] + 1:
            assert jump.min() > 0.01, order


@pytest.mark.parametrize("kind", ["hermite", "catmull-rom", "cubic"])
def test_smooth_curves_begin_and_end_at_rest(kind: str) -> None:
    curve = curve_through(kind, TIMES, VALUES)
    assert curve(TIMES[[0, -1]], 1) == pytest.approx(0.0, abs=1e-9)


def test_rates_are_those_that_were_given_or_those_of_the_neighbours() -> None:
    given = curve_through("hermite", TIMES, VALUES, RATES)
    assert given(TIMES, 1) == pytest.approx(RATES)
    still = curve_through("hermite", TIMES, VALUES)
    assert still(TIMES, 1) == pytest.approx(0.0, abs=1e-12)
    rates = curve_through("catmull-rom", TIMES, VALUES)(TIMES, 1)
    assert rates[1] == pytest.approx((VALUES[2] - VALUES[0]) / 1.0)
    assert rates[2] == pytest.approx((VALUES[3] - VALUES[1]) / 1.8)


def test_straight_lines_and_cubics_are_kept() -> None:
    """Each kind reproduces what it is made for: linear a line, hermite a cubic with its rates,
    a polynomial one of degree 4."""
    fine = np.linspace(0.0, 3.0, 200)
    line = curve_through("linear", TIMES, 2.0 * TIMES[:, None] - 1.0)
    assert line(fine)[:, 0] == pytest.approx(2.0 * fine - 1.0)
    cubic = np.poly1d([1.0, -2.0, 0.5, 3.0])
    kept = curve_through("hermite", TIMES, cubic(TIMES)[:, None], cubic.deriv()(TIMES)[:, None])
    assert kept(fine)[:, 0] == pytest.approx(cubic(fine))
    whole = curve_through("polynomial", TIMES, VALUES)
    assert whole(fine) == pytest.approx(BarycentricInterpolator(TIMES, VALUES)(fine), abs=1e-6)
    assert np.diff(whole.x).max() <= FINE + 1e-12


def test_only_a_polynomial_and_a_spline_feel_a_change_far_away() -> None:
    """Local curves are the same up to the neighbour of the key that changed."""
    changed = VALUES.copy()
    changed[4] += 1.0
    early = np.linspace(0.0, 1.0, 20)
    for kind in KINDS:
        curves = [curve_through(kind, TIMES, values)(early) for values in (VALUES, changed)]
        moved = np.abs(curves[1] - curves[0]).max()
        assert (moved > 1e-4) == (kind in ("cubic", "polynomial")), kind


def test_a_polynomial_through_many_keys_overshoots() -> None:
    """Runge's function: 11 keys, values up to 1, and nearly 2 off the function between them."""
    times = np.linspace(-5.0, 5.0, 11)
    values = 1.0 / (1.0 + times[:, None] ** 2)
    fine = np.linspace(-5.0, 5.0, 500)
    error = {kind: np.abs(curve_through(kind, times, values)(fine)[:, 0] - 1.0 / (1.0 + fine**2))
             for kind in ("polynomial", "catmull-rom")}  # fmt: skip
    assert error["polynomial"].max() > 1.8 and error["catmull-rom"].max() < 0.1


def test_errors_name_what_is_wrong() -> None:
    with invalid("interpolation", "'bezier'", "catmull-rom"):
        curve_through("bezier", TIMES, VALUES)
    with invalid("interpolation", "'cubic'"):
        curve_through("cubic", TIMES, VALUES, RATES)
    with invalid("interpolation", "16", "17"):
        curve_through("polynomial", np.arange(17.0), np.ones((17, 1)))
