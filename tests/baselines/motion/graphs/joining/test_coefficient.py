"""The coefficient is the energy of the curve that `insert` makes, and its best duration is best."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicHermiteSpline

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.graphs.joining.coefficient import (
    best_duration,
    coefficient,
    moved_shares,
)
from tests.support.refused import invalid, refused

RNG = np.random.default_rng(0)


def drawn(n: int = 6) -> tuple[np.ndarray, ...]:
    return (*RNG.normal(size=(3, n)), RNG.uniform(0.0, 1.0, n))


def test_it_is_the_bending_energy_of_the_cubic() -> None:
    """To 1e-9, against quadrature of SciPy's Hermite spline."""
    for _ in range(30):
        gap, before, after, masses = drawn()
        duration = float(RNG.uniform(0.2, 2.0))
        curve = CubicHermiteSpline([0.0, duration], [0.0 * gap, gap], [before, after])
        energy = quad(lambda t, c=curve, m=masses: float(c(t, 2) ** 2 @ m), 0.0, duration)[0]
        assert coefficient(gap, before, after, masses, duration) == pytest.approx(energy, rel=1e-9)


@pytest.mark.parametrize("time_price", [0.0, 3.0])
def test_the_best_duration_is_that_of_a_search(time_price: float) -> None:
    """K(D) of a gap Δ is that of Δ/D in a second, over D, so that one call has the whole grid."""
    grid = np.linspace(0.2, 2.0, 4001)
    inside = 0
    for _ in range(100):
        way, before, after, masses = drawn(3)
        gap = 0.3 * way + 0.6 * (before + after)  # not far from where the rates lead
        values = coefficient(gap / grid[:, None], before, after, masses, 1.0) / grid
        values += time_price * grid
        price = best_duration(gap, before, after, masses, time_price=time_price)
        whole = price.coefficient + time_price * price.duration
        assert whole <= values.min() + 1e-9
        assert whole == pytest.approx(values.min(), rel=1e-4)
        inside += 0.21 < price.duration < 1.99
    assert inside > 10


def test_what_goes_on_as_it_was_costs_nothing() -> None:
    """Δ = D v with one rate is a straight line; many pairs are taken at once."""
    rate, masses = RNG.normal(size=4), np.ones(4)
    assert coefficient(0.7 * rate, rate, rate, masses, 0.7) == pytest.approx(0.0, abs=1e-12)
    gaps = RNG.normal(size=(5, 3, 4))
    many = coefficient(gaps, rate, 0 * rate, masses, 0.5)
    assert many.shape == (5, 3)
    assert many[2, 1] == pytest.approx(coefficient(gaps[2, 1], rate, 0 * rate, masses, 0.5))


def test_a_joint_moves_what_hangs_on_it() -> None:
    skeleton = read_bvh(find_bvh("humanoid_punch")).clip.skeleton
    shares = moved_shares(skeleton).reshape(-1, 3)[:, 0]
    assert shares[0] == shares[1] == 1.0
    share = {role: shares[1 + joint] for role, joint in skeleton.roles.items()}
    assert share["hip_left"] > share["knee_left"] > share["ankle_left"] > 0.0
    assert share["hip_left"] < 0.5 and share["shoulder_left"] > share["elbow_left"]


def test_wrong_durations_are_refused() -> None:
    gap, before, after, masses = drawn()
    with refused("range", "duration", above=0, value="0"):
        coefficient(gap, before, after, masses, 0.0)
    with invalid("duration", "0"):
        best_duration(gap, before, after, masses, 2.0, 1.0)
