"""Many environments in threads: the same bits as each alone."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.balance.vector.scheduler import MANY
from tests.support.shared import robot

PUSHES = {"magnitude": [0.1, 1.2], "unit": "specific_impulse", "start": [0.0, 0.1]}


def make(kind=ResidualBalanceEnv, **changes):
    return kind(robot(), duration=0.3, pushes=PUSHES, **changes)


def actions(steps, n, kind=ResidualBalanceEnv):
    return np.random.default_rng(5).uniform(-1.0, 1.0, (steps, n, *make(kind).action_space.shape))


def run(threads, n=3, steps=25, kind=ResidualBalanceEnv):
    """All that a batch returns, step by step."""
    batch, ends = EnvBatch([make(kind) for _ in range(n)], threads), []
    record = [batch.reset([10 + i for i in range(n)]).copy()]

    def at_end(i, env):
        ends.append((i, env.steps, env.fallen))

    for action in actions(steps, n, kind):
        batch.step(action, at_end)
        record += [batch.observations.copy(), batch.rewards.copy(), batch.final_observations.copy()]
        record += [batch.terminated.copy(), batch.truncated.copy()]
    batch.close()
    return record, ends


def test_the_number_of_threads_changes_nothing():
    """One, two and more threads than environments give the same bits and the same ends."""
    one, ends = run(1)
    for threads in (2, 7):
        other, other_ends = run(threads)
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
        assert ends == other_ends
    assert len(ends) >= 3


@pytest.mark.parametrize(
    "kind",
    [
        ResidualBalanceEnv,
        ResidualStepEnv,
        ResidualWholeEnv,
        TorqueBalanceEnv,
        PositionBalanceEnv,
        VelocityEnv,
    ],
)
def test_nor_where_steps_are_shared_out_tick_by_tick(kind):
    """As they are with many environments for each thread."""
    n = 2 * MANY + 1
    one, ends = run(1, n, 20, kind)
    other, other_ends = run(2, n, 20, kind)
    assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    assert ends == other_ends and len(ends) >= n


def test_a_batch_is_its_environments():
    """Each row equals a single environment that is reset when its episode ends."""
    record, _ = run(2)
    for i in range(3):
        env = make()
        assert np.array_equal(record[0][i], env.reset(seed=10 + i)[0])
        for k, action in enumerate(actions(25, 3)[:, i]):
            observation, reward, terminated, truncated, _ = env.step(action)
            seen, rewards, final, done, late = record[1 + 5 * k : 6 + 5 * k]
            assert rewards[i] == reward and done[i] == terminated and late[i] == truncated
            if terminated or truncated:
                assert np.array_equal(final[i], observation)
                observation, _ = env.reset()
            assert np.array_equal(seen[i], observation)


def test_options_are_per_environment():
    """Each environment starts with its own options."""
    batch = EnvBatch([make(), make()])
    push = {"impulse": 3.0, "body": "torso"}
    batch.reset([0, 0], [{"push": []}, {"push": push}])
    assert [len(env.simulation.pushes) for env in batch.envs] == [0, 1]


def test_an_error_in_a_thread_reaches_the_caller():
    """A bad action is the same ConfigError as without threads."""
    batch = EnvBatch([make(), make()], threads=2)
    batch.reset([0, 1])
    bad = np.zeros((2, *make().action_space.shape))
    bad[1, 0] = np.nan
    with pytest.raises(ConfigError, match="com_x is nan"):
        batch.step(bad)
    batch.close()


def test_environments_that_do_not_fit_together_are_refused():
    """None, two kinds, or one twice."""
    env = make()
    for envs, problem in (
        ([], "at least one"),
        ([env, make(residual={"lean": 0.1})], "same spaces"),
        ([env, env], "twice"),
    ):
        with pytest.raises(ConfigError, match=problem):
            EnvBatch(envs)
