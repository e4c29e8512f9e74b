"""The planar pendulums: energy, the free knee, and the first-order pendulum as a limit."""

import numpy as np
import pytest

from poise.envs.robots.robot import load_robot
from tests.performance.knee_bound import plane_of
from tests.performance.planar_stances import G, Stance, acceleration, free_knee, spring

BODY = plane_of(load_robot("human"))


def test_the_knee_of_the_second_order_pendulum_is_free() -> None:
    """The force that moves the mass, by its path alone, has no moment about the knee."""
    stance = free_knee(BODY, 0.06)
    time = np.linspace(stance.time[0] + 0.02, stance.time[-1] - 0.02, 9)
    hip = [np.interp(time, stance.time, stance.hip[:, a]) for a in range(2)]
    h = 0.01
    later, before = (
        [np.interp(time + s, stance.time, stance.hip[:, a]) for a in range(2)] for s in (h, -h)
    )
    accel = [(later[a] - 2.0 * hip[a] + before[a]) / h**2 for a in range(2)]
    knee = [np.interp(time, stance.time, stance.knee[:, a]) for a in range(2)]
    moment = (hip[0] - knee[0]) * (accel[1] + G) - (hip[1] - knee[1]) * accel[0]
    assert np.abs(moment).max() < 0.03 * G * BODY.thigh  # h's error, and of the interpolation
    assert np.degrees(stance.flexion).min() > 2.0


def test_a_cop_at_the_ankle_makes_it_the_first_order_pendulum() -> None:
    """θ̈ = g sin θ/ℓ, N = m (g cos θ − ℓ θ̇²)."""
    body = BODY.__class__(**{**BODY.__dict__, "ankle": 0.0})
    length = body.thigh + body.shank
    for theta, rate in ((0.1, 0.5), (-0.2, 0.8)):
        theta_acc, force = acceleration(body, theta, rate, 0.0)
        assert theta_acc == pytest.approx(G * np.sin(theta) / length, abs=1e-4)
        assert force == pytest.approx(G * np.cos(theta) - length * rate**2, abs=1e-3)


def energy_of(stance: Stance, stiffness: float, rest: float) -> np.ndarray:
    speed = np.gradient(stance.hip, stance.time, axis=0)
    length = np.hypot(*stance.hip.T)
    stored = 0.5 * stiffness * (rest - length) ** 2
    return (0.5 * (speed**2).sum(axis=1) + G * stance.hip[:, 1] + stored)[3:-3]


def test_the_spring_keeps_its_energy_and_bends_its_knee() -> None:
    """The spring's knee is bent by several times what the free knee is [Zhao, fig. 10]."""
    stance = spring(BODY, kappa=18.0)
    mid = int(np.argmin(np.abs(stance.hip[:, 0])))
    rest = float(stance.hip[mid, 1] / (1.0 - 1.0 / 18.0))
    energy = energy_of(stance, 18.0 * G / rest, rest)
    assert np.ptp(energy) < 2e-3
    assert stance.flexion.mean() > 3.0 * free_knee(BODY, 0.06).flexion.mean()
