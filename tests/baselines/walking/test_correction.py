"""baselines/walking/correction.py: velocity by leg odometry, and the command that it corrects."""

import numpy as np
import pytest

from poise.baselines.walking.correction import MOST, Correction, correct_course, odometry
from tests.support.physics import forward
from tests.support.shared import generic_state

COMMAND = np.array([0.5, 0.1, -0.2, *np.zeros(5)])


def lower_sole(state):
    return int(np.argmin(state.sole_point[:, 2]))


def moved(seed, change):
    """The state after `change(simulation, state)` has set its velocity."""
    simulation = generic_state(seed=seed)
    change(simulation, simulation.state_arrays)
    forward(simulation)
    return simulation.state_arrays


@pytest.mark.parametrize("seed", range(4))
def test_of_a_robot_on_a_resting_sole_it_is_the_coms_velocity(seed):
    """q̇ projected on the null space of the lower sole's J: ṡ = 0, so that v = ċ."""

    def rest(simulation, state):
        i = lower_sole(state)
        J = state.J[6 * i : 6 * i + 6]
        simulation.data.qvel[:] -= np.linalg.pinv(J) @ (J @ simulation.data.qvel)

    state = moved(seed, rest)
    cos, sin = state.heading
    ahead, left, turn = odometry(state)
    np.testing.assert_allclose(
        [cos * ahead - sin * left, sin * ahead + cos * left], state.com_vel[:2], atol=1e-9
    )
    assert np.hypot(ahead, left) > 0.05
    assert turn == pytest.approx((state.root_axes @ state.qvel[3:6])[2])


@pytest.mark.parametrize("seed", range(4))
def test_it_does_not_need_the_velocity_of_the_root(seed):
    """A velocity added to the root's moves CoM and soles alike, and no robot measures it."""

    def drift(simulation, state):
        simulation.data.qvel[:3] += (0.7, -0.4, 0.2)

    found, drifting = (odometry(moved(seed, change)) for change in (lambda *_: None, drift))
    np.testing.assert_allclose(drifting, found, atol=1e-12)


def correction(command, rate=0.01):
    state = moved(0, lambda *_: None)
    return Correction(state, command, np.zeros(3), np.zeros(3), np.zeros(3), 0.04, rate)


def test_the_error_of_the_mean_is_integrated_up_to_a_limit():
    """v̄ ← v̄ + part (v − v̄), then δ ← δ + k T (c − v̄)."""
    c = correction(COMMAND)
    correct_course(c)
    mean = 0.04 * np.array(odometry(c.state))
    np.testing.assert_allclose(c.mean, mean)
    np.testing.assert_allclose(c.shift, 0.01 * (COMMAND[:3] - mean))
    c.mean[:] = COMMAND[:3] - (9.0, -9.0, 9.0)
    for _ in range(10):
        correct_course(c)
    np.testing.assert_allclose(c.shift, [MOST, -MOST, MOST])


@pytest.mark.parametrize(
    ("command", "active"),
    [((0.0, 0.0, 0.0), ()), ((0.0, 0.0, 0.5), (2,)), ((0.0, 0.2, 0.0), (0, 1, 2))],
)
def test_what_is_not_commanded_to_move_is_not_corrected(command, active):
    """Standing has no δ, turning in place that of the turn alone."""
    c = correction(np.array([*command, *np.zeros(5)]))
    c.shift[:] = 0.1
    correct_course(c)
    assert tuple(np.flatnonzero(c.shift)) == active
