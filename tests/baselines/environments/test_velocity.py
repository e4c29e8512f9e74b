"""Joint servos that walk as commanded: what is observed, rewarded and counted of the command."""

import numpy as np
import pytest

from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.walking.correction import MEAN_TIME
from poise.configs.errors import ConfigError
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.vector.batch import EnvBatch, replicate
from poise.envs.physics.pushes.push import Kick
from tests.support.shared import robot

REST = {"pushes": None, "duration": 2.0}
COURSE = [{"ahead": 0.3, "left": -0.1}, {"ahead": 0.5, "turn": 0.4, "start": 0.1}, {"start": 0.2}]


def places(env, name):
    """Where a term lies in the observation."""
    first = 0
    for term in env.terms:
        if term.name == name:
            return slice(first, first + term.size)
        first += term.size
    raise AssertionError(name)


def played(env, steps, seed=3, size=0.1, **options):
    """Observations, rewards' terms and true states of so many steps."""
    rng = np.random.default_rng(seed)
    rows = [env.reset(seed=seed, options=options)[0].copy()]
    terms, states = [], []
    for _ in range(steps):
        rows.append(env.step(rng.uniform(-size, size, env.action_space.shape))[0].copy())
        terms.append(env.episode.reward_terms.copy())
        s = env.simulation.state
        states.append((s.com_vel.copy(), s.heading.copy(), s.root_axes.copy(), s.qvel.copy()))
    return np.array(rows), np.array(terms), states


def test_the_command_is_observed_when_its_time_has_come():
    """Of each command of a course from its start on, in the units of the table."""
    env = VelocityEnv(robot(), **REST)
    seen, _, _ = played(env, 15, command=COURSE)
    commanded = np.array([[0.3, -0.1, 0.0]] * 5 + [[0.5, 0.0, 0.4]] * 5 + [[0.0] * 3] * 6)
    velocity = seen[:, places(env, "command_velocity")] * env.scales.velocity
    turn = seen[:, places(env, "command_turn")] * 0.2 * env.scales.omega
    np.testing.assert_allclose(np.hstack([velocity, turn]), commanded, atol=1e-6)
    assert env.command.array()[:3].tolist() == [0.0, 0.0, 0.0]


def test_the_mean_velocity_is_a_low_pass_of_the_true_one():
    """The error of the command, step by step, beside the same in NumPy."""
    env = VelocityEnv(robot(), **REST)
    mean, part = np.zeros(3), 1.0 - np.exp(-env.config.policy_period / MEAN_TIME)
    rng = np.random.default_rng(0)
    env.reset(seed=1, options={"command": {"ahead": 0.4, "left": 0.1, "turn": -0.3}})
    for _ in range(25):
        env.step_without_info(rng.uniform(-0.3, 0.3, env.action_space.shape))
        s = env.simulation.state
        yaw = np.arctan2(s.heading[1], s.heading[0])
        c, w = np.exp(-1j * yaw), s.root_axes @ s.qvel[3:6]
        v = c * complex(*s.com_vel[:2])
        mean += part * (np.array([v.real, v.imag, w[2]]) - mean)
        np.testing.assert_allclose(env.info()["velocity_error"], mean - [0.4, 0.1, -0.3], atol=1e-9)
    assert abs(mean).max() > 0.02


def test_rewards_are_of_the_command():
    """`velocity`, `turning`, `quiet` and `power` beside their formulas."""
    only = {"velocity": 1.0, "turning": 1.0, "quiet": 1.0, "power": 1.0}
    env = VelocityEnv(robot(), reward={"effort": 0.0, **only}, **REST)
    command = np.array([0.4, -0.2, 0.5])
    for told, quiet in ((command, False), (np.zeros(3), True)):
        env.reset(
            seed=1, options={"command": dict(zip(("ahead", "left", "turn"), told, strict=True))}
        )
        rng = np.random.default_rng(0)
        for _ in range(10):
            _, _, _, _, info = env.step(rng.uniform(-0.3, 0.3, env.action_space.shape))
            s, found, (unit, omega) = env.simulation.state, info["reward_terms"], scales(env)
            c, sn = s.heading
            ahead = np.array([c * told[0] - sn * told[1], sn * told[0] + c * told[1]])
            away = np.sum((s.com_vel[:2] - ahead) ** 2)
            assert found["velocity"] == pytest.approx(np.exp(-away / unit**2))
            spin = s.root_axes @ s.qvel[3:6] - [0.0, 0.0, told[2]]
            assert found["turning"] == pytest.approx(np.exp(-(spin @ spin) / (0.5 * omega) ** 2))
            still = np.exp(-((np.linalg.norm(s.com_vel) / env.limits.quiet_speed) ** 2) / 4.0)
            assert found["quiet"] == pytest.approx(still if quiet else 0.0)
            power = np.sum(abs(env.data.ctrl * s.qvel[env.robot.motor_dofs]))
            full = env.robot.mass * 9.81 * omega * env.scales.height
            assert found["power"] == pytest.approx(-power / (power + full), rel=1e-3)


def scales(env):
    """The units of velocities and rates."""
    return env.scales.velocity, env.scales.omega


def test_without_a_command_it_is_the_position_environment():
    """Commanded to stand, the same actions give the same bits of robot and reward."""
    weights = {"velocity": 0.5, "turning": 0.1, "quiet": 0.3}
    terms = {"terms": ["gravity", "root_rate", "joint_pos", "joint_vel", "last_action"]}
    same = {"reward": weights, "observation": terms, **REST}
    one, other = VelocityEnv(robot(), None, **same), PositionBalanceEnv(robot(), None, **same)
    first, rewards, _ = played(one, 20, command=[])
    second, others, _ = played(other, 20)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(rewards, others)


def test_it_observes_what_is_measured():
    """20 ms late it sees the step before, and nothing that leads it on."""
    now = VelocityEnv(robot(), **REST)
    late = VelocityEnv(robot(), realism={"latency": {"sense": 0.02}}, **REST)
    first, _, _ = played(now, 10, command={"ahead": 0.2})
    second, _, _ = played(late, 10, command={"ahead": 0.2})
    for term in ("joint_pos", "joint_vel", "gravity", "root_rate"):
        own = places(now, term)
        np.testing.assert_allclose(second[2:, own], first[1:-1, own], atol=1e-6)
        assert abs(second[2:, own] - first[2:, own]).max() > 1e-4


def test_a_critic_sees_the_error_of_the_command():
    """Privileged terms are the true velocity error, which no sensor gives."""
    hidden = {"privileged": ["velocity_error", "turn_error", "friction"]}
    env = VelocityEnv(robot(), realism="field", observation=hidden, **REST)
    seen, _, _ = played(env, 10, command={"ahead": 0.3, "turn": 0.2})
    error = env.info()["velocity_error"]
    shown = seen[-1, places(env, "true_velocity_error")] * env.scales.velocity
    np.testing.assert_allclose(shown, error[:2], atol=1e-6)
    turn = seen[-1, places(env, "true_turn_error")] * 0.2 * env.scales.omega
    np.testing.assert_allclose(turn, error[2:], atol=1e-6)
    assert env.seen == seen.shape[1] - 4


def test_commands_are_drawn():
    """The same of the same seed, another of another; ranges as given."""
    ranges = {"ahead": [-0.5, 1.5], "turn": [-1.0, 1.0], "interval": [0.1, 0.2]}
    env = VelocityEnv(robot(), command=ranges, **REST)
    turn = places(env, "command_turn")
    one, again, other = (played(env, 20, seed=seed)[0][:, turn] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert len(np.unique(one)) >= 3 and not np.array_equal(one, other)
    assert abs(one * 0.2 * env.scales.omega).max() <= 1.0


def test_success_is_not_to_fall():
    """As in the benchmark of walks: what is off its command has not failed, what falls has."""
    env = VelocityEnv(robot(), pushes=None, duration=2.0)
    for ahead, kick, well in ((0.0, 0.0, True), (0.5, 0.0, True), (0.5, 4.0, False)):
        pushes = {"push": Kick(0.2, kick, 90.0)} if kick else {}
        env.reset(seed=0, options={"command": {"ahead": ahead}, **pushes})
        while env.episode.running:
            env.step_without_info(np.zeros(env.action_space.shape))
        assert env.recovered == well == (not env.fallen), ahead


def test_threads_change_nothing():
    """The same bits with one thread and with two."""
    ranges = {"ahead": [0.0, 1.0], "interval": [0.1, 0.2]}
    found = []
    for threads in (1, 2):
        envs = replicate(VelocityEnv(robot(), command=ranges, realism="field", duration=0.4), 3)
        batch = EnvBatch(envs, threads)
        rows, rng = [batch.reset([1, 2, 3])], np.random.default_rng(0)
        for _ in range(30):
            batch.step(rng.uniform(-0.5, 0.5, (3, *envs[0].action_space.shape)))
            rows += [batch.observations, batch.rewards]
        batch.close()
        found.append(np.concatenate([np.ravel(row) for row in rows]))
    np.testing.assert_array_equal(*found)


def test_a_wrong_command_names_the_field():
    """As `CommandSampler` and `parse_commands` say it."""
    with pytest.raises(ConfigError, match="sideways"):
        VelocityEnv(robot(), command={"sideways": 1.0})
    env = VelocityEnv(robot(), **REST)
    with pytest.raises(ConfigError, match="speed"):
        env.reset(options={"command": {"speed": 1.0}})
