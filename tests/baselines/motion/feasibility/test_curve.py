"""The curve of a join keeps its ends, has the least jerk, and its knots change no end."""

import numpy as np
import pytest
from scipy.integrate import quad_vec

from poise.baselines.motion.feasibility.curve import Boundary, Curve, bend_shapes, jerk_matrix


@pytest.fixture
def ends() -> tuple[Boundary, Boundary]:
    rng = np.random.default_rng(3)
    return Boundary(*rng.normal(size=(3, 4))), Boundary(*rng.normal(size=(3, 4)))


def bent(curve: Curve) -> Curve:
    return curve._replace(bends=np.random.default_rng(4).normal(size=curve.bends.shape))


def test_ends_are_kept_with_two_derivatives(ends: tuple[Boundary, Boundary]) -> None:
    for curve in (plain := Curve.between(*ends, 0.7), bent(plain)):
        for share, end in zip((0.0, 1.0), ends, strict=True):
            for derivative, wanted in enumerate(end):
                got = curve.at(np.array([share]), derivative)[0]
                np.testing.assert_allclose(got, wanted, atol=1e-9 * 50**derivative)


def test_derivatives_are_of_time(ends: tuple[Boundary, Boundary]) -> None:
    curve, step = bent(Curve.between(*ends, 0.7)), 1e-5
    s = np.array([0.13, 0.4, 0.81])
    for derivative in range(2):
        beside = [curve.at(s + sign * step / 0.7, derivative) for sign in (-1.0, 1.0)]
        difference = (beside[1] - beside[0]) / (2.0 * step)
        np.testing.assert_allclose(difference, curve.at(s, derivative + 1), rtol=1e-5, atol=1e-4)


def test_energy_is_that_of_the_acceleration(ends: tuple[Boundary, Boundary]) -> None:
    curve, masses = bent(Curve.between(*ends, 0.7)), np.array([1.0, 0.3, 2.0, 0.1])

    def rate(t: float) -> np.ndarray:
        return np.asarray(curve.at(np.array([t / 0.7]), 2)[0] ** 2 @ masses)

    wanted = quad_vec(rate, 0.0, 0.7, points=[0.175, 0.35, 0.525], epsrel=1e-10)[0]
    assert curve.energy(masses) == pytest.approx(float(wanted), rel=1e-8)


def test_bends_add_their_own_jerk_and_no_more(ends: tuple[Boundary, Boundary]) -> None:
    """The curve of the fifth order has the least jerk: the mixed term is 0."""
    plain = Curve.between(*ends, 0.7)
    curve = bent(plain)
    s = (np.arange(40_000) + 0.5) / 40_000

    def jerk(one: Curve) -> np.ndarray:
        return np.asarray((one.at(s, 3) ** 2).mean(axis=0) * 0.7)

    added = np.einsum("in,ij,jn->n", curve.bends, jerk_matrix(), curve.bends) / 0.7**5
    np.testing.assert_allclose(jerk(curve) - jerk(plain), added, rtol=1e-4)


def test_shapes_are_three_that_rest_at_both_ends() -> None:
    for derivative in range(3):
        np.testing.assert_allclose(bend_shapes(np.array([0.0, 1.0]), derivative), 0.0, atol=1e-9)
    assert np.linalg.matrix_rank(bend_shapes(np.linspace(0.0, 1.0, 9))) == 3
