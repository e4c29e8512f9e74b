"""The packaged controllers of the models walk, and their stance legs do as the models say."""

import numpy as np
import pytest

from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.walking.planner.command import GaitCommand


def walked(controller, seconds=6.0, compiled=True):
    """The environment after a walk at 0.5 m/s, and the knees' flexions of legs that stand alone."""
    env = ResidualStepEnv(controller=controller, duration=30.0)
    env.reset(seed=2, options={"push": []})
    env.controller.command = GaitCommand(0.5)
    env._compiled = env._compiled and compiled
    action, flexions, places = np.zeros(len(env.action_names)), [], []
    for _ in range(round(seconds / 0.02)):
        env.step(action)
        r = env.controller.reference
        if env.simulation.time > 3.0:
            flexions += [r.legs.flexion[i] for i in range(2) if r.share[0, i] == 1.0]
            places.append(env.simulation.state.com[0])
    return env, np.degrees(flexions), np.array(places)


@pytest.mark.parametrize(
    ("model", "low", "high"), [("rigid", 5.0, 27.0), ("spring", 22.0, 50.0), ("double", 2.0, 25.0)]
)
def test_a_model_walks_with_its_own_knees(model, low, high):
    """Springs keep the knee bent; the pendulum of two rods has it nearly straight."""
    env, flexions, places = walked(f"walk-{model}")
    assert not env.fallen and env.controller.walking and env.controller.failures == 0
    assert (places[-1] - places[0]) / (0.02 * (len(places) - 1)) == pytest.approx(0.5, abs=0.06)
    assert low < np.median(flexions) < high


def test_compiled_and_python_ticks_of_a_model_are_the_same_bits():
    ends = []
    for compiled in (True, False):
        env, _, _ = walked("walk-double", 2.0, compiled)
        ends.append(np.concatenate([env.simulation.data.qpos, env.simulation.data.qvel]))
    np.testing.assert_array_equal(*ends)
