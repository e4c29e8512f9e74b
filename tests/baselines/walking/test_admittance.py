"""baselines/walking/admittance.py: a walk gives way to a push for a while, and to nothing else."""

import numpy as np
import pytest

from poise.baselines.walking.admittance import DEAD, MOST, Admittance, give_way
from poise.baselines.walking.calibration import Calibration, observed_ahead, observed_left
from poise.baselines.walking.correction import MEAN_TIME, Correction, correct_course, odometry
from tests.support.physics import forward
from tests.support.shared import generic_state

PERIOD = 0.02  # [s]


def moving(speed):
    """A robot's state in which `odometry`, which is linear in q̇, has found `speed` (2,)."""
    simulation = generic_state(seed=1)

    def found(qvel):
        simulation.data.qvel[:] = qvel
        forward(simulation)
        return np.array(odometry(simulation.state_arrays)[:2])

    rows = np.array([found(unit) for unit in np.eye(simulation.data.qvel.size)]).T
    np.testing.assert_allclose(found(np.linalg.pinv(rows) @ speed), speed, atol=1e-9)
    return simulation.state_arrays


def laws(state, part, gain=1.0, ahead=0.0):
    command, found, mean = np.array([ahead, *np.zeros(7)]), np.zeros(3), np.zeros(3)
    slow = 1.0 - np.exp(-PERIOD / MEAN_TIME)
    course = Correction(state, command, found, mean, np.zeros(3), slow, 0.0)
    return course, Admittance(command, found, mean, np.zeros(2), np.zeros(2), part, gain)


def taken(course, admittance):
    correct_course(course)
    give_way(admittance)
    return admittance.way.copy()


@pytest.mark.parametrize("gain", [0.5, 1.0])
def test_it_is_the_change_of_velocity_as_far_as_it_leaves_the_command(gain):
    """y = κ (1 − d/‖w − c‖) (w − v̄), w = v at once where `part` is 1."""
    speed = np.array([0.6, -0.5])
    course, admittance = laws(moving(speed), 1.0, gain, ahead=0.2)
    way = taken(course, admittance)
    size = np.linalg.norm(speed - (0.2, 0.0))
    assert size > DEAD
    np.testing.assert_allclose(way, gain * (1.0 - DEAD / size) * (speed - course.mean[:2]))


def test_what_is_near_the_command_or_leads_to_it_is_no_push():
    """Less than the dead zone off; from rest to the commanded speed; braked after a push."""
    near = laws(moving([0.7, 0.1]), 1.0, ahead=0.5)
    starts = laws(moving([0.5, 0.0]), 1.0, ahead=1.0)
    brakes = laws(moving([0.8, 0.0]), 1.0)
    brakes[1].mean[:2] = 1.5, 0.0
    for each in (near, starts, brakes):
        np.testing.assert_array_equal(taken(*each), 0.0)


def test_what_lasts_gives_nothing():
    """It becomes the mean, after some `MEAN_TIME`."""
    both = laws(moving([1.5, 0.0]), 1.0)
    ways = [taken(*both)[0] for _ in range(int(5 * MEAN_TIME / PERIOD))]
    assert ways[0] > 0.9
    assert np.all(np.diff(ways) <= 0.0)
    assert ways[-1] < 0.02


def test_each_axis_has_a_limit():
    np.testing.assert_array_equal(taken(*laws(moving([3.0, -4.0]), 1.0)), [MOST, -MOST])


def test_it_is_added_to_what_is_observed():
    """u = f(c + δ) + y, also where the robot stands and is not to walk."""
    arrays = Calibration(ahead=((0.0, 0.0), (1.0, 2.0)), left=((0.0, 0.0), (1.0, 3.0))).arrays()
    command = np.array([0.5, 0.25, *np.zeros(6)])
    assert observed_ahead(arrays, command, False, 0.1, -0.4) == pytest.approx(1.2 - 0.4)
    assert observed_left(arrays, command, False, 0.05, 0.2) == pytest.approx(0.9 + 0.2)
    assert observed_ahead(arrays, np.zeros(8), False, 0.0, 0.7) == 0.7
