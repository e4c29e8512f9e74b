"""baselines/walking/evasion.py: a push that the gyro shows is observed as a command for a while."""

import numpy as np
import pytest

from poise.baselines.walking.calibration import Calibration
from poise.baselines.walking.evasion import AGAIN, FELT, HOLD, OFF, ROLL, Evasion, evade
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from tests.support.shared import generic_state

PERIOD, OMEGA = 0.02, 3.5
KNOTS = ((0.0, -0.3, 0.1, -0.8), (90.0, 0.0, 0.2, -0.4), (180.0, 0.4, 0.3, 0.6))


def law(knots=KNOTS, **command):
    state = generic_state(seed=1).state_arrays
    asked = np.zeros(8)
    for name, value in command.items():
        asked[("ahead", "left", "turn").index(name)] = value
    return Evasion(state, asked, np.array(knots).reshape(-1, 4), np.array([0.0, 0.0, 0.0, AGAIN]),
                   np.zeros(3), OMEGA, PERIOD)  # fmt: skip


def shown(evasion, roll, pitch, yaw=0.0):
    """What is added to the command in a policy step with these rates of the root [√(g/h)]."""
    evasion.state.qvel[3:6] = OMEGA * roll, OMEGA * pitch, OMEGA * yaw
    evade(evasion)
    return evasion.shown.copy()


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 150.0, 180.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_turns_by_the_direction_of_the_push(angle, side):
    """A, σ L, σ T of θ, the mirror image on the other side."""
    size, at = 1.5 * FELT, np.radians(angle)
    found = shown(law(), -side * size * np.sin(at) / ROLL - side * 1e-9, size * np.cos(at))
    knots = np.array(KNOTS)
    expected = [np.interp(angle, knots[:, 0], column) for column in knots[:, 1:].T]
    np.testing.assert_allclose(found, expected * np.array([1.0, side, side]), atol=1e-6)


def test_what_is_chosen_is_kept_for_a_while():
    """Though the trunk swings back meanwhile; the next push is felt after `AGAIN`."""
    evasion = law()
    first = shown(evasion, -0.3, 0.5)
    steps = round(AGAIN / PERIOD)
    later = [shown(evasion, 0.9, -0.9) for _ in range(steps + 1)]
    held = round(HOLD / PERIOD) - 1
    np.testing.assert_array_equal(later[:held], np.tile(first, (held, 1)))
    np.testing.assert_array_equal(later[held + 1 : steps - 1], 0.0)
    assert later[-1].any() and (later[-1] != first).all()


def test_no_push_no_turn():
    """Of rates below the threshold, and without knots."""
    assert not shown(law(), 0.4 * FELT / ROLL, 0.8 * FELT).any()
    assert not shown(law(knots=()), 1.0, 1.0).any()


def test_a_push_off_the_middle_is_left_to_the_policy():
    """Until the next."""
    evasion, size = law(), np.hypot(ROLL * 0.3, 0.5)
    assert not shown(evasion, 0.3, 0.5, -1.1 * OFF * size).any()
    assert not shown(evasion, 0.3, 0.5).any()
    assert shown(law(), 0.3, 0.5, 0.9 * OFF * size).any()


@pytest.mark.parametrize("command", [{"ahead": 0.5}, {"left": -0.2}, {"turn": 0.3}])
def test_who_walks_does_not_evade(command):
    """Nor does it while it comes to rest."""
    evasion = law(**command)
    assert not shown(evasion, 1.0, 1.0).any()
    evasion.command[:] = 0.0
    stops = [shown(evasion, 1.0, 1.0) for _ in range(round(AGAIN / PERIOD) + 2)]
    assert not np.any(stops[:-3]) and stops[-1].all()


@pytest.mark.parametrize("angles", [[0, 170], [10, 180], [0, 90, 90, 180]])
def test_knots_are_of_all_directions(angles):
    knots = [[angle, 0.1, 0.0, 0.2] for angle in angles]
    with pytest.raises(ConfigError, match="evasion: angles must increase from 0 to 180°"):
        build(Calibration, {"evasion": knots}, "own.yaml")
