"""Policies that run more often than they were trained to: what they observe."""

import numpy as np
import pytest

from poise.envs.balance.torque import TorqueBalanceEnv
from tests.support.refused import invalid
from tests.support.shared import robot

TERMS = ["com_vel", "last_action", "joint_pos"]


def played(env: TorqueBalanceEnv, actions: np.ndarray) -> np.ndarray:
    """Return the observations of an episode (steps + 1, no), in double precision."""
    env.reset(seed=4)
    seen = [env.episode.observation.copy()]
    for action in actions:
        env.step(action)
        seen.append(env.episode.observation.copy())
    return np.array(seen)


@pytest.mark.parametrize(("history", "stride"), [(1, 3), (3, 2), (3, 5), (2, 4)])
def test_frames_are_a_period_apart_and_older_ones_are_means(history: int, stride: int) -> None:
    """As the equation says, from what an environment without a stride observes at every step."""
    chosen = {"terms": TERMS, "history": history, "history_stride": stride}
    period = {"policy_period": 0.004}
    env = TorqueBalanceEnv(robot(), pushes=None, observation=chosen, **period)
    single = TorqueBalanceEnv(robot(), pushes=None, observation={"terms": TERMS}, **period)
    rng = np.random.default_rng(8)
    actions = rng.uniform(-0.2, 0.2, (18, *env.action_space.shape))
    raw, seen = played(single, actions), played(env, actions)
    raw = np.concatenate([np.repeat(raw[:1], history * stride + stride, axis=0), raw])
    nu = actions.shape[1]
    is_action = np.zeros(raw.shape[1], dtype=bool)
    is_action[3 : 3 + nu] = True
    weight = np.ones(2 * (stride // 2) + 1)
    if stride % 2 == 0:
        weight[0] = weight[-1] = 0.5
    weight /= stride

    def mean(now: int, lag: int) -> np.ndarray:
        reach = len(weight) // 2
        return weight @ raw[now - lag - reach : now - lag + reach + 1]

    for step, whole in enumerate(seen):
        now = step + history * stride + stride
        expected = []
        for j in reversed(range(history)):
            frame = mean(now, j * stride) if j else raw[now]
            expected.append(np.where(is_action, mean(now, j * stride + stride - 1), frame))
        np.testing.assert_allclose(whole, np.concatenate(expected), atol=1e-12)
    assert [t.name for t in env.terms[-3:]] == TERMS
    mirror, _ = env.mirrors()
    assert mirror.order.shape == seen[0].shape


def test_actions_of_every_step_count_where_they_are_held() -> None:
    """An action held for a period is, a period later, the last action that was observed in it."""
    chosen = {"terms": ["last_action"], "history_stride": 5}
    env = TorqueBalanceEnv(robot(), pushes=None, observation=chosen, policy_period=0.004)
    nu = env.action_space.shape[0]
    held = np.repeat([[0.1], [-0.05], [0.02]], 5, axis=0) * np.ones(nu)
    seen = played(env, held)[:, 0]
    np.testing.assert_allclose(seen[[7, 12]], [0.1, -0.05], atol=1e-12)
    assert seen[0] == 0.0 and 0.0 < seen[4] < 0.1


@pytest.mark.parametrize("stride", [0, 1.5, 101])
def test_a_stride_is_a_number_of_steps(stride: float) -> None:
    with invalid("observation.history_stride"):
        TorqueBalanceEnv(robot(), observation={"history_stride": stride})
