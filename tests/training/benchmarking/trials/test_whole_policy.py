"""The packaged policy of Unitree's G1: servos take over where feet in place would not do."""

import numpy as np
import pytest

from poise.baselines.environments.whole import ResidualWholeEnv
from poise.envs.robots.menagerie import WHEEL
from poise.training.benchmarking.trials.agents import Agent, load_agent
from tests.support.shared import robot

NAME = "residual-whole-g1"
STRONG = {"specific_impulse": 1.2, "direction": 30.0, "duration": 0.1, "start": 0.3}


@pytest.fixture(scope="module")
def agent() -> Agent:
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    return load_agent(NAME, robot("unitree_g1"), duration=6.0, pushes=None)


def track(agent: Agent, push: object) -> tuple[bool, list[float], np.ndarray]:
    """Whether it recovered, the servos' shares, and where it ended."""
    env, shares = agent.env, []
    env.reset(seed=4, options={"push": push, "noise": 0.0})
    while env.episode.running:
        env.step_without_info(agent.act(env.episode.observation))
        shares.append(getattr(env, "authority", 0.0))
    return env.recovered and not env.fallen, shares, env.data.qpos.copy()


def test_a_strong_push_is_recovered_where_the_controller_falls(agent: Agent) -> None:
    """Servos take over within the push, and hand back a robot that stands."""
    push = {**STRONG, "body": "torso_link"}
    assert isinstance(agent.env, ResidualWholeEnv)
    recovered, shares, _ = track(agent, push)
    took = np.flatnonzero(np.array(shares) > 0.0)
    assert recovered and 0.3 <= 0.02 * took[0] <= 0.36 and shares[-1] == 0.0
    alone = load_agent("momentum-qp", robot("unitree_g1"), duration=6.0, pushes=None)
    assert not track(alone, push)[0]


def test_unpushed_it_is_the_controller(agent: Agent) -> None:
    """Bit for bit: it never takes over."""
    recovered, shares, end = track(agent, [])
    alone = load_agent("momentum-qp", robot("unitree_g1"), duration=6.0, pushes=None)
    assert recovered and not any(shares)
    np.testing.assert_array_equal(track(alone, [])[2], end)
