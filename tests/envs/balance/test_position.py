"""The position environment: what the action does, that zero stands, and its specification."""

import inspect
import re

import numpy as np
import pytest

from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import coarser_robot
from tests.support.refused import invalid
from tests.support.shared import robot
from tests.support.weekly import daily

PUSH = {"impulse": 5.0, "start": 0.03, "body": "torso"}


@pytest.fixture(scope="module")
def env():
    return PositionBalanceEnv(robot())


def test_it_is_a_simulation_with_pd_in_every_physics_step(env):
    """An episode equals a plain loop over Simulation, to rounding."""
    env.reset(seed=2, options={"push": PUSH})
    data, servos, limit = env.simulation.data, env.servos, robot().torque_limit
    simulation = Simulation(robot())
    simulation.reset(data.qpos.copy(), data.qvel.copy(), env.simulation.pushes)
    dofs, rng, energy = robot().motor_dofs, np.random.default_rng(0), 0.0
    for _ in range(8):
        action = rng.uniform(-0.2, 0.2, env.action_space.shape)
        env.step(action)
        for _ in range(env.substeps):
            q, v = simulation.data.qpos[dofs + 1], simulation.data.qvel[dofs]
            tau = servos.stiffness * (servos.hold + servos.reach * action - q) - servos.damping * v
            tau = np.clip(tau, -limit, limit)
            energy += abs(tau * v).sum() * env.arrays.timestep
            simulation.step(tau)
        np.testing.assert_allclose(simulation.data.qpos, data.qpos, atol=1e-7)
        np.testing.assert_allclose(simulation.data.qvel, data.qvel, atol=1e-5)
        np.testing.assert_allclose(data.ctrl, tau, atol=1e-3)
    metrics = env.episode.metrics
    assert metrics.ticks == 80 and metrics.peak_torque == 1.0
    assert metrics.energy == pytest.approx(energy, rel=1e-5)


@pytest.mark.parametrize("name", daily(["humanoid", "toddler", "compact", "tall"], 2))
@pytest.mark.parametrize("timestep", [0.002, 0.005])
def test_action_zero_stands(name, timestep):
    """Unpushed for a minute, in either physics step: at rest in the end, close to the posture."""
    long = {"duration": 60.0, "pushes": None}
    env = PositionBalanceEnv(coarser_robot(robot(name), timestep), **long)
    env.reset(seed=1)
    action = np.zeros(env.action_space.shape)
    while env.episode.running:
        env.step_without_info(action)
    assert env.recovered and not env.fallen
    assert abs(env.simulation.state.qvel).max() < 0.01
    assert abs(env.simulation.state.q - env.arrays.q_standing).max() < 0.1


def test_a_late_state_does_not_delay_the_servos():
    """With late sensors and the same actions the robot moves as before; it is seen later."""
    now = PositionBalanceEnv(robot(), pushes=None)
    level, late_state = {"latency": {"sense": 0.02}}, {"predictor": "none"}
    late = PositionBalanceEnv(robot(), pushes=None, realism=level, estimator=late_state)
    actions = np.random.default_rng(4).uniform(-0.1, 0.1, (10, *now.action_space.shape))
    first, _ = now.reset(seed=0)
    late.reset(seed=0)
    seen = [first]
    for action in actions:
        seen.append(now.step(action)[0])
        observation = late.step(action)[0]
        # motors add up in another order
        np.testing.assert_allclose(late.data.qpos, now.data.qpos, atol=1e-9)
    place = [term.name for term in now.terms].index("joint_pos")
    begin = sum(term.size for term in now.terms[:place])
    own = slice(begin, begin + now.terms[place].size)
    np.testing.assert_allclose(observation[own], seen[-2][own], atol=1e-6)
    assert abs(observation[own] - seen[-1][own]).max() > 1e-4


def test_observation_and_spaces_are_those_of_the_torque_environment(env):
    """What differs is what an action does."""
    torque = TorqueBalanceEnv(robot())
    assert env.observation_space == torque.observation_space
    assert env.action_space == torque.action_space and env.action_names == torque.action_names
    one, _ = env.reset(seed=5)
    other, _ = torque.reset(seed=5)
    assert np.array_equal(one, other)


def test_others_like_it_have_its_servos():
    """What `replicate` makes moves as the first does."""
    env = PositionBalanceEnv(robot(), servos={"deflection": 0.5, "reach": {"*": 0.3}})
    again = PositionBalanceEnv(**env.arguments())
    assert again.servo_config == env.servo_config
    assert np.array_equal(again.servos.stiffness, env.servos.stiffness)
    plain = PositionBalanceEnv(robot())
    assert not np.array_equal(plain.servos.stiffness, env.servos.stiffness)


@pytest.mark.parametrize(
    ("servos", "error"),
    [
        ({"deflection": 0.0}, ("deflection", "0")),
        ({"gain": 1.0}, ("gain", "deflection")),
        ({"stiffness": {"*": -1.0}}, ("stiffness.*", "0")),
        ([1.0], ("servos",)),
    ],
)
def test_wrong_servos_are_one_line(servos, error):
    with invalid(*error) as caught:
        PositionBalanceEnv(robot(), servos=servos)
    assert "\n" not in str(caught.value)


def test_the_class_docstring_is_the_specification(env):
    """Its table tells of every term, and no mark is left in it."""
    text = inspect.getdoc(PositionBalanceEnv)
    for term in env.terms:
        assert f"| {term.name} |" in text and f"| {term.unit} | {term.meaning} |" in text
    assert not re.search(r"<\w+>", text)
