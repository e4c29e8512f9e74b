"""Rotations by vectors, matrices and quaternions [Notes, lectures 2 and 8]: identities."""

import numpy as np
import pytest
from scipy.linalg import polar

from poise.baselines.motion.clips.rotations import (
    about_z,
    angle_between,
    exp,
    inverse,
    log,
    multiply,
    rotate,
    slerp,
)

RNG = np.random.default_rng(0)
AXES = RNG.normal(size=(6, 3)) / 1.0
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)


def skew(axis: np.ndarray) -> np.ndarray:
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rodrigues(axis: np.ndarray, angle: float) -> np.ndarray:
    """R = I + sin θ K + (1 − cos θ) K²."""
    return np.eye(3) + np.sin(angle) * skew(axis) + (1.0 - np.cos(angle)) * skew(axis) @ skew(axis)


@pytest.mark.parametrize("angle", [0.3, 2.0, np.pi - 1e-3, np.pi + 1e-3, 4.0, 6.0])
def test_rodrigues_holds_beyond_half_a_turn(angle: float) -> None:
    """Exp of a vector of any length is Rodrigues' matrix; Log gives the turn of at most π back,
    beyond half a turn that of 2π − θ about the opposite axis."""
    v = RNG.normal(size=3)
    for axis in AXES:
        turned = rotate(exp(angle * axis), v)
        assert turned == pytest.approx(rodrigues(axis, angle) @ v, abs=1e-12)
        back = log(exp(angle * axis))
        expected = angle * axis if angle <= np.pi else -(2.0 * np.pi - angle) * axis
        assert back == pytest.approx(expected, abs=1e-9)


def test_a_product_is_one_turn_after_the_other() -> None:
    """(a b) v = a (b v), which does not commute; (a b)* = b* a*; a* is the turn back."""
    a, b = exp(1.1 * AXES[0]), exp(-0.7 * AXES[1])
    v = RNG.normal(size=3)
    both = rotate(multiply(a, b), v)
    assert both == pytest.approx(rodrigues(AXES[0], 1.1) @ rodrigues(AXES[1], -0.7) @ v)
    assert np.linalg.norm(both - rotate(multiply(b, a), v)) > 0.1
    assert inverse(multiply(a, b)) == pytest.approx(multiply(inverse(b), inverse(a)))
    assert rotate(inverse(a), rotate(a, v)) == pytest.approx(v)


def test_q_and_minus_q_are_one_rotation() -> None:
    """They turn alike, are at no angle from each other, and slerp goes the shorter way to both."""
    a, b, v = about_z(0.4), about_z(2.9), RNG.normal(size=3)
    assert rotate(-a, v) == pytest.approx(rotate(a, v))
    assert angle_between(a, -a) == pytest.approx(0.0, abs=1e-7)
    assert log(-a) == pytest.approx(log(a))
    for u in (0.25, 0.5, 0.75):
        half = slerp(a, -b, u)
        assert angle_between(half, slerp(a, b, u)) == pytest.approx(0.0, abs=1e-7)
        assert angle_between(a, half) == pytest.approx(2.5 * u)


def test_interpolations_of_axis_and_angle_and_of_matrices_are_not_slerp() -> None:
    """What lecture 2 says of each: halfway between rotation vectors is another rotation than
    halfway between quaternions, and the mean of two matrices is no rotation."""
    a, b = exp(2.0 * AXES[0]), exp(2.0 * AXES[1])
    middle = slerp(a, b, 0.5)
    vectors = exp(0.5 * (log(a) + log(b)))
    assert angle_between(middle, vectors) > 0.02
    matrices = 0.5 * (rodrigues(AXES[0], 2.0) + rodrigues(AXES[1], 2.0))
    assert abs(np.linalg.det(matrices)) < 0.9
    angles = [angle_between(a, slerp(a, b, u)) for u in (0.25, 0.5, 0.75, 1.0)]
    assert np.diff([0.0, *angles]) == pytest.approx(angles[-1] / 4.0)


@pytest.mark.parametrize("steps", [100, 1000])
def test_rates_are_integrated_on_the_sphere(steps: int) -> None:
    """q Exp(ω dt) again and again is Exp(ω t), of norm 1; q + ½ q ω dt grows by
    √(1 + (|ω| dt/2)²) each time, and normalised turns by 2 atan(|ω| dt/2) instead of |ω| dt."""
    omega, dt = 3.0 * AXES[2], 2.0 / steps
    exact = added = about_z(0.0)
    half = 0.5 * np.linalg.norm(omega) * dt
    for _ in range(steps):
        exact = multiply(exact, exp(omega * dt))
        added = added + 0.5 * dt * multiply(added, np.array([0.0, *omega]))
    assert angle_between(exact, exp(2.0 * omega)) == pytest.approx(0.0, abs=1e-7)
    assert np.linalg.norm(exact) == pytest.approx(1.0, abs=1e-12)
    assert np.linalg.norm(added) == pytest.approx((1.0 + half**2) ** (steps / 2))
    late = exp(2.0 * steps * np.arctan(half) * AXES[2])
    assert angle_between(added / np.linalg.norm(added), late) == pytest.approx(0.0, abs=1e-6)


def test_a_matrix_that_has_drifted_is_made_orthogonal_again() -> None:
    """R + dt [ω] R has RᵀR = 1 + (|ω| dt)² beside its axis; the nearest rotation, by the polar
    decomposition, is at the angle that Σ atan(|ω| dt) gives."""
    dt, steps, R = 0.01, 200, np.eye(3)
    for _ in range(steps):
        R = R + dt * skew(AXES[3]) @ R
    stretch = (1.0 + dt**2) ** (steps / 2)
    assert np.linalg.svd(R)[1] == pytest.approx([stretch, stretch, 1.0])
    assert np.linalg.det(R) == pytest.approx(stretch**2)
    again = polar(R)[0]
    assert again @ again.T == pytest.approx(np.eye(3))
    assert again == pytest.approx(rodrigues(AXES[3], steps * np.arctan(dt)), abs=1e-9)
