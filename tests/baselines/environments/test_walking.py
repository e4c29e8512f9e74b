"""`ResidualWalkEnv`, and the commands of every environment whose controller walks."""

import gymnasium
import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.walking import ResidualWalkEnv
from poise.baselines.registry import load_controller
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import CommandSampler
from poise.envs.physics.pushes.push import Kick
from poise.envs.sensing.realism import load_realism
from tests.support.refused import invalid, refused
from tests.support.shared import robot

FAST = {"ahead": 0.4}
SHORT = {"pushes": None, "duration": 4.0}


@pytest.fixture(scope="module")
def env():
    return ResidualWalkEnv(robot(), command=FAST, **SHORT)


@pytest.fixture(scope="module")
def plain():
    return ResidualBalanceEnv(robot(), controller="walk", **SHORT)


def play(env, seconds, action=None):
    """Steps of one action, zero if not given; returns the last observation."""
    action = np.zeros(env.action_space.shape) if action is None else action
    for _ in range(round(seconds / env.config.policy_period)):
        env.step_without_info(action)
    return env.episode.observation.copy()


def test_action_zero_is_the_planner_bit_for_bit(env, plain):
    """As the controller alone, whose command is an option, or is set after the reset."""
    ends = []
    env.reset(seed=3)
    play(env, 3.0)
    ends.append(env.simulation.data.qpos.copy())
    assert env.info()["steps"] >= 3
    plain.reset(seed=3, options={"command": FAST})
    play(plain, 3.0)
    ends.append(plain.simulation.data.qpos.copy())
    plain.reset(seed=3)
    plain.command = GaitCommand(0.4)
    play(plain, 3.0)
    ends.append(plain.simulation.data.qpos.copy())
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def test_compiled_steps_are_those_of_python(env):
    """The same walk under a policy, ticks called from Python: observations, rewards, strides."""
    ends, names = [], env.action_names
    action = np.zeros(len(names))
    action[names.index("com_x")], action[names.index("foothold_y")] = 0.2, 0.1
    assert env.compiled_step() is not None
    for compiled in (True, False):
        env._compiled = compiled
        env.reset(seed=2)
        rows = [play(env, 0.4, action) for _ in range(7)]
        ends.append((np.array(rows), env.episode.reward_terms.copy(), env.info()["velocity_error"]))
    env.controller = env.controller  # compiled again
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)


def test_commands_change_at_their_times(plain):
    """Each from its start on; one that is set by hand ends the commands of the reset."""
    later = {"ahead": 0.2, "turn": 0.1, "start": 0.1}
    plain.reset(seed=1, options={"command": [FAST, later, {"start": 0.2}]})
    seen = []
    for _ in range(11):
        seen.append(plain.command.ahead)
        plain.step_without_info(np.zeros(4))
    assert seen == [0.4] * 5 + [0.2] * 5 + [0.0]
    plain.reset(seed=1, options={"command": [FAST, later]})
    plain.command = {"ahead": 0.3}
    play(plain, 0.2)
    assert plain.command == GaitCommand(0.3)
    plain.reset(seed=1)
    assert plain.command == GaitCommand()


def test_commands_need_a_controller_that_walks():
    """One line with the controllers that do; nothing else takes a command."""
    standing = ResidualBalanceEnv(robot(), pushes=None, duration=0.1)
    with invalid("command", "simbicon", "walk", source="reset"):
        standing.reset(options={"command": FAST})
    with invalid("command", source="environment"):
        standing.command = GaitCommand(0.1)
    assert standing.command is None
    with invalid("controller", "walk"):
        ResidualWalkEnv(robot(), controller="capture-step")
    torques = gymnasium.make("poise/TorqueBalance-v0")
    with invalid("command", source="reset"):
        torques.reset(options={"command": FAST})
    walking = ResidualBalanceEnv(robot(), controller="walk", pushes=None, duration=0.1)
    with refused("unknown field", "speed", source="command"):
        walking.command = {"speed": 1.0}


def entries(env, name):
    """The entries of a term of the last observation."""
    first = 0
    for term in env.terms:
        if term.name == name:
            return env.episode.observation[first : first + term.size]
        first += term.size
    raise KeyError(name)


def test_what_is_observed_of_a_walk(env):
    """The command in its units; the stance foot opposite to the swing; a phase that goes round."""
    env.reset(seed=1, options={"command": {"ahead": 0.3, "left": 0.1, "turn": -0.2}})
    way, omega = env.scales.velocity, env.scales.omega
    np.testing.assert_allclose(entries(env, "command_velocity"), [0.3 / way, 0.1 / way])
    np.testing.assert_allclose(entries(env, "command_turn"), [-0.2 / (0.2 * omega)])
    assert not entries(env, "stance").any() and not entries(env, "gait_phase").any()
    play(env, 2.5)
    phases, both = [], 0
    for _ in range(50):
        play(env, 0.02)
        swing, stance = entries(env, "swing").copy(), entries(env, "stance").copy()
        assert stance.sum() == 1.0 and stance @ swing == 0.0
        both += not swing.any()
        sin, cos = entries(env, "gait_phase")
        phases.append(np.arctan2(sin, cos) % (2.0 * np.pi))
    turns = np.diff(phases)
    assert 3 <= both <= 25  # steps on both feet between the swings
    assert 2 <= np.sum(turns < 0.0) <= 4 and np.mean(turns >= 0.0) > 0.9


def test_the_error_of_a_stride_is_that_of_the_walk(env):
    """The mean velocity of two steps less the command; tracking is its reward."""
    env.reset(seed=1)
    zero, places, counts = np.zeros(env.action_space.shape), [], []
    for _ in range(190):
        env.step_without_info(zero)
        places.append(env.simulation.state.com[0])
        counts.append(env.controller.steps)
    lifted = np.flatnonzero(np.diff(counts)) + 1
    assert len(lifted) >= 5
    time = 0.02 * (lifted[-1] - lifted[-3])
    error = (places[lifted[-1]] - places[lifted[-3]]) / time - 0.4
    found = env.info()["velocity_error"]
    assert found[0] == pytest.approx(error, abs=2e-3) and abs(found[1]) < 0.05
    s, terms = env.scales, env.info()["reward_terms"]
    off, spin = np.hypot(*found[:2]) / (0.1 * s.velocity), found[2] / (0.05 * s.omega)
    weight = env.config.reward.tracking
    assert terms["tracking"] == pytest.approx(weight * np.exp(-(off**2) - spin**2))


def test_success_is_not_to_fall(env):
    """A walk that lags its command has not failed; one that falls has."""
    env.reset(seed=1)
    play(env, 2.5)
    env._strides.error[0] = 0.5
    assert not env.fallen and env.info()["is_success"] is True
    env.reset(seed=1, options={"push": Kick(0.5, 4.0, 90.0)})
    while env.episode.running:
        env.step_without_info(np.zeros(env.action_space.shape))
    assert env.fallen and env.info()["is_success"] is False


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ({"ahead": [0.2, 9.0]}, ("command.ahead", "9", "'humanoid'", "1.85 m/s")),
        ({"ahead": [-3.0, 0.5]}, ("command.ahead", "-3 m/s")),
        ({"ahead": 0.0, "left": [-0.1, 4.0]}, ("command.left", "4 m/s")),
    ],
)
def test_what_may_be_drawn_is_within_reach_when_the_environment_is_made(command, said):
    """One line with the robot's limits; nothing waits for the draw that goes wrong."""
    with invalid(*said) as caught:
        ResidualWalkEnv(robot(), command=command, **SHORT)
    assert "\n" not in str(caught.value)


def test_commands_are_drawn_by_the_environments_own_generator():
    """A vector environment draws another schedule in each, the same for the same seed."""
    ranges = {"ahead": [0.2, 0.6], "turn": [-0.2, 0.2], "interval": [0.1, 0.2]}
    many = gymnasium.make_vec("poise/ResidualWalk-v0", num_envs=2, command=ranges, **SHORT)
    told = []
    for _ in range(2):
        many.reset(seed=5)
        for _ in range(12):
            *_, info = many.step(np.zeros(many.action_space.shape, dtype=np.float32))
        told.append(info["command"])
    np.testing.assert_array_equal(told[0], told[1])
    assert np.all(told[0][0] != told[0][1], where=[True, False, True])
    assert np.all((told[0][:, 0] >= 0.2) & (told[0][:, 0] <= 0.6))
    env = many.unwrapped.envs[0]
    assert env.command_sampler == CommandSampler((0.2, 0.6), turn=(-0.2, 0.2), interval=(0.1, 0.2))
    assert len(np.unique(env._timetable.commands[:8, 0])) == 8
    many.close()


def test_where_state_and_robot_are_uncertain_another_one_walks():
    """`walk` there is `walk-field` bit for bit, in a copy too; late, and after, it is itself.

    A controller that a user has put in stays.
    """
    env = ResidualBalanceEnv(robot(), controller="walk", **SHORT)
    field = ResidualBalanceEnv(robot(), controller="walk-field", realism="field", **SHORT)

    mine = load_controller("walk-fast", robot())

    def end(env, level):
        env.realism = load_realism(level)
        _, info = env.reset(seed=4, options={"command": FAST})
        replaced = env is not field and level == "field" and env.controller is not mine
        assert info.get("stand_in") == ("walk-field" if replaced else None)
        play(env, 1.0)
        return env.simulation.data.qpos.copy()

    itself, late = end(env, "ideal"), end(env, "late")
    other = end(field, "field")
    np.testing.assert_array_equal(end(env, "field"), other)
    np.testing.assert_array_equal(end(type(env)(**env.arguments()), "field"), other)
    np.testing.assert_array_equal(end(env, "ideal"), itself)
    np.testing.assert_array_equal(end(env, "late"), late)
    assert np.abs(itself - late).max() > 1e-6 and np.abs(end(field, "ideal") - itself).max() > 1e-3
    env.controller = mine
    end(env, "field")
    assert env.controller is mine
