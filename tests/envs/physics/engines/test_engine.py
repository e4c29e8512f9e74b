"""The interface of what steps a robot: another engine is stepped by the same arrays."""

import copy
import importlib.util

import mujoco
import numpy as np
import pytest

from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.compiled.callbacks import Callback
from poise.envs.physics.engines.config import load_physics
from poise.envs.physics.engines.engine import Engine
from tests.support.refused import invalid
from tests.support.shared import robot

PUSH = {"impulse": 8.0, "direction": 200.0, "start": 0.05}


class Outside(Engine):
    """MuJoCo, but as another engine is called."""

    def __init__(self, robot, data, fails_at=None):
        super().__init__(robot, data)
        self.steps, self.begun, self.fails_at = 0, 0, fails_at
        self.callback = Callback(self.step)

    @property
    def stepper(self):
        return self.callback.address

    def step(self):
        if self.steps == self.fails_at:
            raise OSError("the engine stalls")
        self.steps += 1
        mujoco.mj_step2(self.robot.model, self.data)

    def begin(self):
        self.begun += 1

    def check(self):
        self.callback.check()


def played(env, steps=15):
    env.reset(seed=3, options={"push": [PUSH, {"delta_v": 0.3, "direction": 90.0, "start": 0.1}]})
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(0.2 * rng.uniform(-1.0, 1.0, len(env.action_names)))
    return env


@pytest.mark.parametrize("kind", [TorqueBalanceEnv, PositionBalanceEnv])
@pytest.mark.parametrize("realism", ["ideal", "field"])
def test_what_is_called_from_outside_gives_the_same_bits(kind, realism):
    """Torques, servos, pushes, kicks, sensors, observations and the judge go by the arrays."""
    plain, other = kind(robot(), realism=realism), kind(robot(), realism=realism)
    simulation = other.simulation
    simulation.engine = outside = Outside(simulation.robot, simulation.data)
    played(plain), played(other)
    assert outside.steps == 15 * other.substeps and outside.begun > 0
    np.testing.assert_array_equal(plain.data.qpos, other.data.qpos)
    np.testing.assert_array_equal(plain.episode.observation, other.episode.observation)
    assert plain.episode.metrics.mutable_values() == other.episode.metrics.mutable_values()


def test_a_copy_has_an_engine_of_its_own():
    env = TorqueBalanceEnv(robot())
    env.simulation.engine = Outside(env.robot, env.simulation.data)
    played(env, 3)
    twin = copy.deepcopy(env)
    before = env.simulation.engine.steps
    played(twin, 2)
    assert env.simulation.engine.steps == before
    assert twin.simulation.engine.data is twin.simulation.data
    assert twin.simulation.engine.steps == before + 2 * twin.substeps


def test_what_an_engine_raises_is_raised_by_the_step():
    env = TorqueBalanceEnv(robot())
    env.simulation.engine = Outside(env.robot, env.simulation.data, fails_at=12)
    env.reset(seed=0)
    env.step(np.zeros(env.robot.model.nu))
    with pytest.raises(OSError, match="the engine stalls"):
        env.step(np.zeros(env.robot.model.nu))


def test_an_engine_that_is_not_installed_names_the_extra(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pydrake" else find(name)
    )
    with invalid("engine", source="drake.yaml"):
        load_physics("drake")
