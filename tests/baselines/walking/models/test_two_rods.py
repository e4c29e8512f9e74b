"""The geometry of a leg of two rods, against positions and finite differences."""

import numpy as np
import pytest

from poise.baselines.walking.models.two_rods import (
    flexion_at,
    flexion_motion,
    height_over,
    length_at,
    length_motion,
    rod_angles,
)

THIGH, SHANK = 0.38, 0.33


def hip(theta, phi):
    """(x, z) of the hip from the ankle."""
    return (
        SHANK * np.sin(theta) + THIGH * np.sin(phi),
        SHANK * np.cos(theta) + THIGH * np.cos(phi),
    )


@pytest.mark.parametrize("flexion", [0.0, 0.2, 0.9])
@pytest.mark.parametrize("lean", [-0.4, 0.0, 0.3])
def test_the_rods_end_at_the_hip(flexion, lean):
    """Angles of a hip that lies r(β) along a line: the thigh is turned back by β."""
    r = length_at(THIGH, SHANK, flexion)
    x, z = r * np.sin(lean), r * np.cos(lean)
    theta, phi = rod_angles(THIGH, SHANK, flexion, x, z)
    assert hip(theta, phi) == pytest.approx((x, z), abs=1e-12)
    assert theta - phi == pytest.approx(flexion, abs=1e-12)
    assert flexion_at(THIGH, SHANK, r) == pytest.approx(flexion, abs=1e-7)


def derivatives(value, t, step=1e-4):
    """A function's value, rate and acceleration by central differences."""
    before, now, after = value(t - step), value(t), value(t + step)
    return now, (after - before) / (2.0 * step), (after - 2.0 * now + before) / step**2


def flexion(t):
    return 0.4 + 0.3 * np.sin(3.0 * t)


def test_lengths_and_flexions_move_together():
    beta = derivatives(flexion, 0.17)
    expected = derivatives(lambda t: length_at(THIGH, SHANK, flexion(t)), 0.17)
    moved = length_motion(THIGH, SHANK, *beta)
    np.testing.assert_allclose(moved, expected, atol=1e-6)
    np.testing.assert_allclose(flexion_motion(THIGH, SHANK, *moved), beta, atol=1e-9)


def test_a_height_and_its_rates_over_the_ankle():
    """z² = r² − d² along a path in both horizontal directions."""

    def place(t):
        return np.array([0.5 * t - 0.1 + 0.2 * t**2, 0.04 + 0.1 * t])

    def height(t):
        return np.sqrt(length_at(THIGH, SHANK, flexion(t)) ** 2 - place(t) @ place(t))

    t = 0.23
    length = length_motion(THIGH, SHANK, *derivatives(flexion, t))
    velocity, accel = np.array([0.5 + 0.4 * t, 0.1]), np.array([0.4, 0.0])
    way = place(t) @ place(t), place(t) @ velocity, velocity @ velocity + place(t) @ accel
    np.testing.assert_allclose(height_over(*length, *way), derivatives(height, t), atol=1e-6)
