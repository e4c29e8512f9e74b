"""Torques from readings alone: the bits of the environments, in a world that is not theirs."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import poise
from poise.baselines.controller import WrappedController
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.registry import load_controller
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.physics.pushes.options import parse_pushes
from poise.envs.physics.simulation import Simulation
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.deploy.standalone.controller import StandaloneController, load_standalone
from poise.training.deploy.standalone.readings import Readings
from tests.support.refused import invalid
from tests.support.shared import robot

PUSH = {"impulse": 15.0, "direction": 40.0, "duration": 0.1, "start": 0.06, "body": "torso"}
HARD = {**PUSH, "impulse": 25.0}


def evaluated(agent: Agent, push: object, steps: int) -> tuple[list[np.ndarray], np.ndarray]:
    """qpos and qvel at the start and after each policy step, as `poise evaluate` plays them; and
    the last torques."""
    env = agent.env
    observation, _ = env.reset(seed=5, options={"push": push})
    if agent.begin is not None:
        agent.begin()
    track = [np.concatenate([env.data.qpos, env.data.qvel])]
    for _ in range(steps):
        observation, _, fell, _, _ = env.step(agent.act(observation))
        assert not fell
        track.append(np.concatenate([env.data.qpos, env.data.qvel]))
    limit = env.robot.torque_limit
    return track, np.clip(env.data.ctrl, -limit, limit)


def read(world: Simulation, measured: bool) -> Readings:
    data = world.data
    ground = data.qfrc_constraint[:6].copy() if measured else None
    return Readings.of_mujoco(data.qpos.copy(), data.qvel.copy(), ground)


def outside(
    controller: StandaloneController,
    start: np.ndarray,
    push: dict[str, object] | None,
    steps: int,
    period: float,
    measured: bool,
) -> tuple[list[np.ndarray], np.ndarray]:
    """The same of another world, in which the controller is told readings alone."""
    world, nq = Simulation(controller.robot), controller.robot.model.nq
    state = world.reset(start[:nq], start[nq:])
    if push is not None:
        world.set_pushes(parse_pushes(push, controller.robot, state.support_margin))
    controller.reset(read(world, measured))
    hold = round(controller.period / world.arrays.timestep)
    track, torques = [np.concatenate([world.data.qpos, world.data.qvel])], np.zeros(0)
    for _ in range(steps):
        for _ in range(round(period / controller.period)):
            torques = controller.torques(read(world, measured))
            world.step(torques, hold)
        track.append(np.concatenate([world.data.qpos, world.data.qvel]))
    return track, torques


def same_bits(
    make: Callable[[], Agent], push: dict[str, object] | None, steps: int, measured: bool = True
) -> BalanceEnv:
    """Assert that both worlds go the same way; returns the environment of the evaluation."""
    agent = make()
    expected, last = evaluated(agent, push or [], steps)
    controller = StandaloneController(make())
    period = agent.env.config.policy_period
    track, torques = outside(controller, expected[0], push, steps, period, measured)
    np.testing.assert_array_equal(track, expected)
    np.testing.assert_array_equal(torques, last)
    return agent.env


@pytest.mark.parametrize("name", ["momentum-qp", "residual", "pd", "lqr-lip"])
def test_a_push_that_feet_in_place_recover_from(name: str) -> None:
    """Compiled or called from Python, with a policy on top or none: bit for bit."""
    same_bits(partial(load_agent, name, robot()), PUSH, 40)


@pytest.mark.parametrize("name", ["feedback-step", "residual-step"])
def test_a_recovery_with_steps(name: str) -> None:
    env = same_bits(partial(load_agent, name, robot()), HARD, 120)
    stepper = env.controller
    assert stepper.steps and env.simulation.state.com[2] > 0.8 * env.robot.height_com


def with_action(env: BalanceEnv, entries: float = 0.0, **last: float) -> Agent:
    """An agent whose action is always the same."""
    action = np.full(len(env.action_names), entries)
    action[-1] = last.get("authority", entries)
    return Agent("own", env, lambda observation: action, "")


def whole(authority: float) -> Agent:
    """Servos that take a share of the torques as soon as the push has moved the robot."""
    env = ResidualWholeEnv(robot(), hand_over={"opens": 0.01, "closes": 0.005}, pushes=None)
    return with_action(env, 0.1, authority=authority)


@pytest.mark.parametrize("authority", [0.0, 0.25, 0.5])
def test_servos_that_take_over(authority: float) -> None:
    """None, half or all of the torques, which are new in every physics step."""
    env = same_bits(partial(whole, authority), PUSH, 15)
    assert env.authority == 2.0 * authority


def test_servos_alone() -> None:
    def make() -> Agent:
        return with_action(PositionBalanceEnv(robot(), pushes=None), 0.05)

    assert StandaloneController(make()).period == robot().model.opt.timestep
    same_bits(make, PUSH, 15)


def test_torques_as_actions() -> None:
    agent = load_agent("ppo-torque", robot())
    assert StandaloneController(agent).period == agent.env.config.policy_period
    same_bits(partial(load_agent, "ppo-torque", robot()), PUSH, 15)


def test_a_controller_of_any_kind() -> None:
    """One that has nothing but torques, around another."""

    def make() -> Agent:
        inner = load_controller("feedback-step", robot())
        env = ResidualBalanceEnv(robot(), controller=WrappedController(inner, robot()), pushes=None)
        return with_action(env)

    same_bits(make, HARD, 30)


@pytest.mark.parametrize("name", ["feedback-step", "residual"])
def test_without_force_sensors_the_same_bits_until_it_is_pushed(name: str) -> None:
    """The model's ground does what the world's does."""
    same_bits(partial(load_agent, name, robot()), None, 40, measured=False)


def test_without_force_sensors_it_recovers_too() -> None:
    """The same steps: what the model's ground does not know of the push is small."""
    agent = load_agent("feedback-step", robot())
    expected, _ = evaluated(agent, HARD, 200)
    controller = load_standalone("feedback-step", robot())
    track, _ = outside(controller, expected[0], HARD, 200, 0.02, measured=False)
    assert not np.array_equal(track[40], expected[40])
    assert np.linalg.norm(track[-1][robot().model.nq :]) < 0.3  # quiet
    assert abs(track[-1][2] - expected[-1][2]) < 0.02 * robot().height_com


def test_it_stands_where_and_however_it_is_turned() -> None:
    """Two resets of one controller: another place and heading, the same torques."""
    controller, start = load_standalone("feedback-step", robot()), robot().standing_qpos.copy()
    still = np.zeros(robot().model.nv)
    turned = start.copy()
    turned[:2] += [3.0, -2.0]
    half = np.array([np.cos(1.0), np.sin(1.0)])  # 2 rad of yaw on an upright root
    turned[3:7] = [half[0] * start[3], 0.0, 0.0, half[1] * start[3]]
    found = []
    for qpos in (start, turned, start):
        controller.reset(Readings.of_mujoco(qpos, still))
        found.append(controller.torques(Readings.of_mujoco(qpos, still)))
    np.testing.assert_array_equal(found[2], found[0])
    np.testing.assert_allclose(found[1], found[0], atol=1e-3)


def test_its_names_are_those_of_readings_and_torques() -> None:
    """Joints by name are joints in order; the torques are the motors'."""
    controller = poise.load_standalone("momentum-qp", robot())
    rng = np.random.default_rng(0)
    q = robot().standing_qpos[7:] + 0.01 * rng.normal(size=len(controller.joint_names))
    q = dict(zip(controller.joint_names, q.tolist(), strict=True))
    base = robot().standing_qpos[:3], robot().standing_qpos[3:7], np.zeros(3), np.zeros(3)
    still = dict.fromkeys(controller.joint_names, 0.0)
    shuffled = {name: q[name] for name in reversed(controller.joint_names)}
    torques = []
    for joints, speeds in ((shuffled, still), (list(q.values()), np.zeros(len(q)))):
        controller.reset(Readings(*base, joints, speeds))
        torques.append(controller.torques(Readings(*base, joints, speeds)))
    np.testing.assert_array_equal(*torques)
    assert len(controller.motor_names) == len(torques[0])
    assert np.all(np.abs(torques[0]) <= controller.robot.torque_limit)
    assert controller.motor_names == tuple(robot().joint_names[d - 6] for d in robot().motor_dofs)


def readings(**changes: object) -> Readings:
    start = Readings.of_mujoco(robot().standing_qpos, np.zeros(robot().model.nv))
    return Readings(**{**vars(start), **changes})


BAD = {
    "joint_positions: lacks": {"joint_positions": {}},
    "joint_velocities: has unknown joints: tail": {
        "joint_velocities": {**dict.fromkeys(robot().joint_names, 0.0), "tail": 0.0}
    },
    "joint_positions: must be 21 finite numbers": {"joint_positions": np.zeros(20)},
    "velocity: must be 3 finite numbers": {"velocity": [0.0, np.nan, 0.0]},
    "position: must be 3 finite numbers": {"position": "here"},
    "angular_velocity: must be 3 finite numbers": {"angular_velocity": None},
    "orientation: must be a quaternion of length 1": {"orientation": [2.0, 0.0, 0.0, 0.0]},
    "ground_wrench: must be 6 finite numbers": {"ground_wrench": [0.0, 0.0, 400.0]},
}


@pytest.mark.parametrize("message", BAD)
def test_readings_that_are_none(message: str) -> None:
    """The error names the field; the next good readings are taken as if nothing had been."""
    controller = load_standalone("pd", robot())
    controller.reset(readings())
    expected = controller.torques(readings())
    controller.reset(readings())
    with pytest.raises(ConfigError, match=f"readings: {re.escape(message)}"):
        controller.torques(readings(**BAD[message]))
    np.testing.assert_array_equal(controller.torques(readings()), expected)


def test_it_must_be_told_where_it_starts() -> None:
    with pytest.raises(PoiseError, match="before reset"):
        load_standalone("pd", robot()).torques(readings())


def test_what_is_no_use_outside_is_refused() -> None:
    with invalid("root", source="root-assist"):
        load_standalone("root-assist", robot())
    teacher = ResidualBalanceEnv(robot(), observation={"extra": ["push"]})
    with invalid("observation", source="own"):
        StandaloneController(with_action(teacher))
    with invalid("controller"):
        load_standalone("nothing", robot())


def test_late_sensors_of_a_training_are_the_robots_own() -> None:
    """The delay that a policy learned with is not added to that of the robot."""
    agents = [
        with_action(ResidualBalanceEnv(robot(), realism={"latency": {"sense": delay}}), 0.0)
        for delay in (0.0, 0.02)
    ]
    start = readings(velocity=[0.1, 0.0, 0.0])
    found = []
    for agent in agents:
        controller = StandaloneController(agent)
        controller.reset(start)
        found.append([controller.torques(start), controller.torques(readings())])
    np.testing.assert_array_equal(*found)
