"""The seed's printed solution (6), against an integrator of the linear equations that it solves."""

import pytest
from scipy.integrate import solve_ivp

from poise.baselines.walking.models.seed_form import (
    MOST,
    shank_after,
    shank_growth,
    thigh_coupling,
)

TIME = 0.35


def integrated(theta, rate, phi, phi_rate, growth, coupling):
    """θ and φ at TIME of θ̈ = λ² θ, φ̈ = K θ."""
    end = solve_ivp(
        lambda _, y: [y[1], growth**2 * y[0], y[3], coupling * y[0]],
        (0.0, TIME), [theta, rate, phi, phi_rate], rtol=1e-11, atol=1e-13,
    )  # fmt: skip
    return end.y[0, -1], end.y[2, -1]


@pytest.mark.parametrize("growth", [0.0, 2.0, 9.0])
def test_the_shank_grows_as_its_equation_says(growth):
    expected = integrated(-0.1, 1.1, 0.0, 0.0, growth, 0.0)[0]
    assert shank_after(-0.1, 1.1, growth, TIME) == pytest.approx(expected, abs=1e-9)


def test_both_angles_arrive_at_the_foothold():
    """λ and K by (7), put into the equations, lead to the angles that were wanted."""
    theta, rate, phi, phi_rate = 0.02, 0.9, -0.1, 0.8
    wanted = 0.45, 0.3
    growth = shank_growth(theta, rate, wanted[0], TIME)
    coupling = thigh_coupling(theta, rate, growth, phi, phi_rate, wanted[1], TIME)
    ends = integrated(theta, rate, phi, phi_rate, growth, coupling)
    assert ends == pytest.approx(wanted, abs=1e-7)
    assert growth > 1.0 and coupling != 0.0


def test_what_cannot_be_reached_is_approached():
    """A shank that goes further than λ = 0 takes it, against λ's sign: the nearest is λ = 0."""
    assert shank_growth(0.1, 1.0, 0.2, TIME) == 0.0
    assert shank_growth(0.1, 1.0, 1e4, TIME) == pytest.approx(MOST / TIME)


def test_the_coupling_is_limited():
    """A shank as far ahead as behind has no double integral left: K stays at its bound."""
    rate = 1.0
    theta = -rate * TIME / 3.0  # ∬θ = 0 for λ = 0
    coupling = thigh_coupling(theta, rate, 0.0, 0.0, 0.0, 0.1, TIME)
    assert abs(coupling) == pytest.approx((MOST / TIME) ** 2)
