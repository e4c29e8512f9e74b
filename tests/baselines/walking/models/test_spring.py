"""The spring-loaded pendulum: its energy, its rest, and the knee that has its length."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from poise.baselines.walking.models.reference import RowWeights
from poise.baselines.walking.models.spring import Spring, spring_force
from poise.baselines.walking.models.two_rods import flexion_at
from tests.support.shared import robot

from .test_rigid import answered

REST, GRAVITY = 0.7, 9.81
STIFFNESS = 20.0 * GRAVITY / REST


def test_energy_is_conserved_without_a_damper():
    """½ v² + g z + ½ k/m (ℓ₀ − r)² of a mass that the spring alone carries, over a bounce."""

    def motion(_, y):
        place, velocity = y[:2], y[2:]
        r = np.linalg.norm(place)
        pull = spring_force(STIFFNESS, 0.0, REST, r, place @ velocity / r) / r
        return np.concatenate([velocity, pull * place - [0.0, GRAVITY]])

    def energy(y):
        r = np.linalg.norm(y[:2])
        return 0.5 * y[2:] @ y[2:] + GRAVITY * y[1] + 0.5 * STIFFNESS * max(REST - r, 0.0) ** 2

    path = solve_ivp(motion, (0.0, 0.3), [-0.15, 0.66, 1.0, -0.2], rtol=1e-10, atol=1e-12)
    energies = [energy(y) for y in path.y.T]
    assert np.ptp(energies) < 1e-7
    assert path.y[1].min() < 0.65


def test_a_spring_pushes_only():
    assert spring_force(STIFFNESS, 0.0, REST, 0.71, 0.0) == 0.0
    assert spring_force(STIFFNESS, 5.0, REST, 0.69, 3.0) == 0.0
    assert spring_force(STIFFNESS, 5.0, REST, 0.69, -1.0) == pytest.approx(0.01 * STIFFNESS + 5.0)


def test_it_begins_where_the_hip_is_and_falls_by_the_springs_law():
    """The first tick: at the measured height, at rest, z̈ = k (ℓ₀ − r)/m z/r − g."""
    model = Spring(stiffness=18.0, damping_ratio=0.0, flexion=0.0)
    r = answered(model, (1, 1.0, np.inf))
    legs = r.legs
    place = legs.hip[1] - legs.ankle[1]
    length = np.linalg.norm(place)
    reach = legs.thigh + legs.shank
    expected = 18.0 * 9.81 / reach * (reach - length) * place[2] / length - 9.81
    assert r.height[2] == pytest.approx(expected)
    assert r.height[1] == pytest.approx(0.004 * expected)
    assert abs(r.height[0]) < 1e-3


def test_the_knee_follows_the_length_of_the_spring():
    """The stiffness of the rows acts on the difference of both flexions."""
    asked = [
        answered(
            Spring(rows=RowWeights(knee=1.0, stiffness=k, damping_ratio=0.0)), (1, 1.0, np.inf)
        )
        for k in (0.0, 50.0)
    ]
    legs, rate2 = asked[0].legs, robot().omega ** 2
    length = np.linalg.norm(legs.hip[1] - legs.ankle[1] + [0.0, 0.0, asked[0].height[0]])
    error = flexion_at(legs.thigh, legs.shank, length) - legs.flexion[1]
    assert asked[1].knee[1, 0] - asked[0].knee[1, 0] == pytest.approx(
        50.0 * rate2 * error, rel=1e-6
    )
    assert asked[1].knee[0, 1] == 0.0 and asked[1].knee[1, 1] > 0.0
