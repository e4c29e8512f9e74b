"""The torque environment: what the action does, and its specification."""

import inspect
import re

import numpy as np
import pytest

from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from tests.support.shared import robot


@pytest.fixture(scope="module")
def env():
    return TorqueBalanceEnv(robot())


def test_the_action_is_torque_over_its_limit(env):
    """Each entry drives the motor of its name, up to its limit."""
    env.reset(seed=0)
    action = np.linspace(-1.0, 1.0, len(env.action_names))
    env.step(action)
    np.testing.assert_allclose(env.simulation.data.ctrl, action * robot().torque_limit)
    names = [robot().joint_names[dof - 6] for dof in robot().motor_dofs]
    assert list(env.action_names) == names  # the humanoid's motors are named after their joints


def test_it_is_a_simulation_with_held_torques(env):
    """An episode equals a plain loop over Simulation, bit for bit."""
    env.reset(seed=2, options={"push": {"impulse": 5.0, "start": 0.03, "body": "torso"}})
    data = env.simulation.data
    simulation = Simulation(robot())
    simulation.reset(data.qpos.copy(), data.qvel.copy(), env.simulation.pushes)
    rng = np.random.default_rng(0)
    for _ in range(8):
        action = rng.uniform(-0.5, 0.5, env.action_space.shape)
        env.step(action)
        simulation.step(action * robot().torque_limit, env.substeps)
        assert np.array_equal(simulation.data.qpos, data.qpos)
        assert np.array_equal(simulation.data.qvel, data.qvel)


def test_the_last_action_is_observed_and_its_change_costs(env):
    """The observation ends with the action; the reward counts its size and its change."""
    env.reset(seed=0)
    action = np.full(env.action_space.shape, 0.25)
    first = env.step(action)
    np.testing.assert_array_equal(first[0][-len(action) :], action.astype(np.float32))
    assert first[4]["reward_terms"]["action"] == pytest.approx(-0.1 * 0.25**2)
    assert first[4]["reward_terms"]["action_rate"] < 0.0
    assert env.step(action)[4]["reward_terms"]["action_rate"] == 0.0


def test_no_torque_falls(env):
    """Action zero is a limp robot."""
    env.reset(seed=0, options={"push": []})
    terminated = truncated = False
    while not (terminated or truncated):
        _, _, terminated, truncated, _ = env.step(np.zeros(env.action_space.shape))
    assert terminated


def test_the_class_docstring_is_the_specification(env):
    """Its table tells of every term, and no mark is left in it."""
    text = inspect.getdoc(TorqueBalanceEnv)
    for term in env.terms:
        assert f"| {term.name} |" in text and f"| {term.unit} | {term.meaning} |" in text
    assert not re.search(r"<\w+>", text)
