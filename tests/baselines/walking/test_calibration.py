"""What a policy observes in the place of a command."""

import numpy as np
import pytest

from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.walking.calibration import (
    Calibration,
    observed_ahead,
    observed_left,
    observed_turn,
)
from tests.support.shared import robot

KNOTS = Calibration(
    ahead=((-0.5, -0.6), (0.0, 0.0), (0.1, 0.4), (1.0, 0.9)),
    turn=((0.0, 0.0), (0.5, 0.8)),
    in_place=((0.0, 0.0), (0.5, 0.9)),
    aside=((0.0, 0.0), (0.5, 0.7)),
)
STARTS = Calibration(ahead=((0.0, 0.0), (0.1, 0.0), (1.0, 0.9)), still=0.2, start=(0.5, 0.6, 1.2))


def seen_of(calibration, command, still):
    """Ahead, left and turn of a command as they are observed."""
    kernels = observed_ahead, observed_left, observed_turn
    commands, read = np.array([*command, *np.zeros(5)]), calibration.arrays()
    return [kernel(read, commands, still) for kernel in kernels]


def f(axis, command, walking=0.3):
    commands = [walking] * 3
    commands[axis] = command
    return seen_of(KNOTS, commands, False)[axis]


def test_it_goes_through_its_knots():
    """Linear in between, as np.interp; with a slope of 1 beyond; without knots the identity."""
    at, through = np.array(KNOTS.ahead).T
    for command in np.linspace(-0.5, 1.0, 31):
        assert f(0, command) == pytest.approx(np.interp(command, at, through))
    assert f(0, 1.5) == pytest.approx(1.4) and f(0, -0.7) == pytest.approx(-0.8)
    assert f(1, 0.37) == 0.37


def test_both_sides_are_alike():
    """f(−c) = −f(c) of a turn."""
    for command in (0.2, 0.5, 0.9):
        assert f(2, -command) == pytest.approx(-f(2, command)) != pytest.approx(-command)


def test_turns_in_place_and_steps_aside_have_knots_of_their_own():
    """Where no speed, none ahead is commanded; those of `turn` and `left` elsewhere."""
    assert f(2, 0.5) == pytest.approx(0.8) and f(2, 0.5, walking=0.0) == pytest.approx(0.9)
    assert f(1, 0.5) == pytest.approx(0.5) and f(1, 0.5, walking=0.0) == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("command", "seen"),
    [
        ((0.3, 0.2, 0.4), (0.5, 0.2, 0.4)),  # ahead leads, and 0.3 is less than its start
        ((-0.3, 0.0, 0.0), (-0.5, 0.0, 0.0)),
        ((0.8, 0.0, 0.0), (0.7, 0.0, 0.0)),  # f(0.8) is more than the start, and is kept
        ((0.0, -0.2, 0.4), (0.0, -0.6, 0.4)),
        ((0.0, 0.0, -0.4), (0.0, 0.0, -1.2)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),  # commanded to stand
        ((0.05, 0.0, 0.0), (0.0, 0.0, 0.0)),  # f(0.05) = 0 is to stand
    ],
)
def test_a_robot_that_stands_still_is_told_to_begin(command, seen):
    """sign(c) max(|f(c)|, s) of the axis that leads, the others as they are."""
    np.testing.assert_allclose(seen_of(STARTS, command, True), seen)


def observed(env):
    """The command in the observation [m/s, m/s, rad/s], by the scales of its terms."""
    first, found = 0, {}
    for term in env.terms:
        found[term.name] = env.episode.observation[first : first + term.size].copy()
        first += term.size
    s = env.scales
    return [*found["command_velocity"] * s.velocity, *found["command_turn"] * 0.2 * s.omega]


@pytest.mark.parametrize(("still", "ahead"), [(100.0, 0.5), (1e-9, 0.2), (0.0, 0.2)])
def test_it_begins_where_joints_are_slower_than_that(still, ahead):
    """A robot that moves observes f(c), one that stands still at least the start."""
    env = VelocityEnv(
        robot(), pushes=None, calibration=Calibration(still=still, start=(0.5, 0.6, 1.2))
    )
    env.reset(seed=1, options={"command": {"ahead": 0.2, "left": 0.1}})
    env.step_without_info(np.full(env.action_space.shape, 0.1))
    np.testing.assert_allclose(observed(env), [ahead, 0.1, 0.0], atol=1e-6)


@pytest.mark.parametrize(
    ("axis", "knots", "said"),
    [
        ("ahead", ((0.0, 0.0), (0.5, 0.4), (0.4, 0.6)), "ahead: knots must increase"),
        ("turn", ((0.0, 0.1), (0.5, 0.4)), r"turn: needs the knot \[0, 0\]"),
        ("left", ((-0.5, -0.6), (0.0, 0.0)), "left: must begin"),
    ],
)
def test_what_is_refused(axis, knots, said):
    """Knots that do not increase, that do not stand, or that treat sides differently."""
    with pytest.raises(ValueError, match=said):
        Calibration(**{axis: knots})


def test_a_policy_observes_it():
    """f(c) in the observation, in its units, and c itself in `info` and its error."""
    seen = []
    for calibration in (None, KNOTS):
        env = VelocityEnv(robot(), pushes=None, duration=1.0, calibration=calibration)
        env.reset(seed=1, options={"command": {"ahead": 0.1, "left": 0.2, "turn": -0.5}})
        env.step_without_info(np.zeros(env.action_space.shape))
        seen.append(observed(env))
        np.testing.assert_allclose(env.info()["command"], [0.1, 0.2, -0.5])
        again = type(env)(**env.arguments())  # of a batch
        assert again.calibration == env.calibration
    np.testing.assert_allclose(seen, [[0.1, 0.2, -0.5], [0.4, 0.2, -0.8]], atol=1e-6)
