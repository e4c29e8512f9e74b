"""Stable-Baselines3's view of the batch."""

import numpy as np
import pytest
from stable_baselines3.common.env_util import is_wrapped
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.training.learning.vec_env import ThreadedVecEnv
from tests.support.shared import robot

PUSHES = {"magnitude": [0.1, 1.2], "unit": "specific_impulse", "start": [0.0, 0.1]}


def make(n=2, threads=1, **changes):
    settings = {"duration": 0.2, "pushes": PUSHES, "fall": {"quiet_time": 0.1}, **changes}
    return ThreadedVecEnv([ResidualBalanceEnv(robot(), **settings) for _ in range(n)], threads)


def zeros(env):
    return np.zeros((env.num_envs, *env.action_space.shape), dtype=np.float32)


def test_an_episode_ends_as_sb3_expects():
    """infos hold return, length, success, the last observation and whether time ran out."""
    env = make(pushes=None)
    env.seed(0)
    env.reset()
    total, last = np.zeros(2), None
    for _ in range(10):
        observations, rewards, dones, infos = env.step(zeros(env))
        total += rewards
        if not dones.any():
            assert infos == [{}, {}]
    assert dones.all() and rewards.dtype == np.float32
    for i, info in enumerate(infos):
        assert info["TimeLimit.truncated"] is True and info["is_success"] is True
        assert info["episode"]["l"] == 10
        assert info["episode"]["r"] == pytest.approx(total[i], rel=1e-5)
        last = info["terminal_observation"]
        assert last.shape == observations[i].shape and not np.array_equal(last, observations[i])
    for _ in range(10):
        _, _, _, infos = env.step(zeros(env))
    assert [info["episode"]["l"] for info in infos] == [10, 10]  # counted anew
    assert all(0.0 < info["episode"]["r"] < 1.2 * total[0] for info in infos)


def test_a_fall_is_no_time_limit():
    """An episode that ends by a fall must not be bootstrapped."""
    env = make(pushes=None, duration=2.0)
    env.seed(0)
    env.set_options({"push": {"impulse": 60.0, "body": "torso", "start": 0.0}})
    env.reset()
    done = False
    while not done:
        _, _, dones, infos = env.step(zeros(env))
        done = dones[0]
    assert infos[0]["TimeLimit.truncated"] is False and infos[0]["is_success"] is False


def test_options_are_for_one_reset():
    """set_options serves the next reset only, as in SB3."""
    env = make()
    env.seed(0)
    env.set_options({"push": []})
    env.reset()
    assert all(len(e.simulation.pushes) == 0 for e in env.batch.envs)
    env.reset()
    assert all(len(e.simulation.pushes) == 1 for e in env.batch.envs)


def test_seeds_and_threads():
    """Environments have seeds of their own; the same seed gives the same bits in any threads."""
    runs = []
    for threads in (1, 2):
        env = make(3, threads)
        env.seed(4)
        record = [env.reset()]
        for _ in range(12):
            record.extend(env.step(zeros(env))[:3])
        runs.append(record)
        env.close()
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))
    first = runs[0][0]
    assert not np.array_equal(first[0], first[1])
    env = make(3)
    env.seed(4)
    assert np.array_equal(env.reset(), first)
    assert not np.array_equal(env.reset(), first)  # the seed is for one reset


def test_attributes_and_methods():
    """get_attr, set_attr and env_method reach the environments; none is wrapped."""
    env = make()
    env.set_attr("push_sampler", None, indices=[1])
    assert env.get_attr("push_sampler")[1] is None
    assert env.get_attr("push_sampler", 0)[0].magnitude == (0.1, 1.2)
    env.reset()
    assert env.get_attr("steps") == [0, 0]
    assert len(env.env_method("_references", indices=0)) == 1
    assert env.env_is_wrapped(Monitor) == [False, False] and not is_wrapped(env, Monitor)


def test_it_can_be_normalised():
    """VecNormalize works on top, and returned arrays are not overwritten by later steps."""
    env = VecNormalize(make())
    env.seed(0)
    first = env.reset()
    kept = first.copy()
    env.step(zeros(env))
    assert np.array_equal(first, kept)
    raw = make()
    raw.seed(0)
    first = raw.reset()
    kept = first.copy()
    second = raw.step(zeros(raw))[0]
    assert np.array_equal(first, kept)
    kept = second.copy()
    raw.step(zeros(raw))
    assert np.array_equal(second, kept)
