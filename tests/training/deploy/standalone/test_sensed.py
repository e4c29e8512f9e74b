"""Motor commands from measurements: what is benchmarked is what runs on a robot, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import poise
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import PoiseError
from poise.envs.sensing.config import EstimatorConfig
from poise.envs.sensing.measurement import RING
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.deploy.standalone.readings import Measurement, Readings
from poise.training.deploy.standalone.sensed import MotorCommand, SensedController, typical
from tests.support.refused import invalid
from tests.support.shared import robot

PUSH = {"impulse": 20.0, "direction": 40.0, "duration": 0.1, "start": 0.06, "body": "torso"}
#: no range: the robot of the evaluation is the one that is known
LEVEL = {
    "latency": {"sense": 0.006, "command": 0.004, "misjudged": 0.002},
    "motors": {"lag": 0.005, "gain_error": 0.05, "friction": 0.01},
    "sensors": {"encoder_noise": 2e-4, "velocity_noise": 0.05, "gyro_noise": 0.01, "cop_noise": 0.0,
                "accelerometer_noise": 0.1, "tilt_drift": 0.002, "gyro_bias": 0.005},
    "body": {"mass": 0.02},
}  # fmt: skip


def of_row(rings: object, k: int) -> Measurement:
    """What row `k` of the simulated sensors' memory says."""
    names = ("attitude", "gyro", "force", "q", "dq", "wrench", "found")
    row = {name: getattr(rings, name)[k].copy() for name in names}
    return Measurement(*(row[name] for name in names[:-1]), row["found"][:-1])


def evaluated(
    agent: Agent, steps: int
) -> tuple[list[list[Measurement]], list[MotorCommand], Readings]:
    """Measurements before each control tick of a pushed trial, and what motors were asked for."""
    env = agent.env
    observation, _ = env.reset(seed=3, options={"push": PUSH})
    if agent.begin is not None:
        agent.begin()
    start = Readings.of_mujoco(env.data.qpos.copy(), env.data.qvel.copy())
    rings, motors = env.state_source.sensors.rings, env.state_source.motors
    heard, asked, count = [[of_row(rings, (rings.next + i) % RING) for i in range(RING)]], [], 0
    for _ in range(steps):
        env.set_action(agent.act(observation))
        for _ in range(getattr(env, "ticks", 1)):
            count = rings.next
            env.tick()
            row = (motors.written - 1) % RING
            asked.append(MotorCommand(*(each[row].copy() for each in motors.asked.members())))
            new = (rings.next - count) % RING
            heard.append([of_row(rings, (count + i) % RING) for i in range(new)])
        assert not env.fallen
        observation = env.episode.observation.astype(np.float32)
    return heard, asked, start


def agent_at(name: str) -> Agent:
    agent = load_agent(name, robot())
    agent.env.realism = load_realism(LEVEL)
    return agent


@pytest.mark.parametrize("name", ["momentum-qp", "feedback-step", "residual-torque"])
def test_the_commands_are_those_of_the_benchmark(name: str) -> None:
    heard, asked, start = evaluated(agent_at(name), 60)
    controller = poise.load_standalone(name, robot(), realism=LEVEL)
    assert isinstance(controller, SensedController)
    assert controller.measurements == len(heard[1]) > 0
    controller.reset(start, heard[0])
    for i, expected in enumerate(asked):
        command = controller.command(heard[i] if i else ())
        np.testing.assert_array_equal(command, expected, err_msg=f"tick {i}")


def whole() -> Agent:
    """Servos that have half of the torques as soon as the push has moved the robot."""
    env = ResidualWholeEnv(robot(), hand_over={"opens": 0.01, "closes": 0.005}, pushes=None)
    action = np.full(len(env.action_names), 0.1)
    action[-1] = 0.25
    return Agent("own", env, lambda observation: action, "")


def steps_by_inekf() -> Agent:
    agent = load_agent("feedback-step", robot())
    agent.env.estimator = EstimatorConfig("inekf")
    return agent


@pytest.mark.parametrize("make", [whole, steps_by_inekf])
def test_servos_and_the_other_estimator(make: Callable[[], Agent]) -> None:
    level = load_realism(LEVEL)
    agent = make()
    agent.env.realism = level
    heard, asked, start = evaluated(agent, 15)
    controller = SensedController(make(), level)
    controller.reset(start, heard[0])
    for i, expected in enumerate(asked):
        np.testing.assert_array_equal(controller.command(heard[i] if i else ()), expected)
    assert make is not whole or expected.stiffness.all()


def standing(**fields: object) -> Measurement:
    """At rest, level, with the weight on both feet."""
    body, nj = robot(), len(robot().joint_names)
    weight = np.array([0.0, 0.0, body.mass * 9.81, 0.0, 0.0, 0.0])
    values = dict(
        attitude=[1.0, 0.0, 0.0, 0.0], angular_velocity=np.zeros(3), acceleration=[0.0, 0.0, 9.81],
        joint_positions=dict(zip(body.joint_names, body.standing_qpos[7:], strict=True)),
        joint_velocities=np.zeros(nj), ground_wrench=weight, contacts=[True, True],
    )  # fmt: skip
    return Measurement(**{**values, **fields})


START = Readings.of_mujoco(robot().standing_qpos, np.zeros(robot().model.nv))


def test_at_rest_it_holds_the_robot() -> None:
    controller = poise.load_standalone("momentum-qp", robot(), realism="lab")
    assert np.ptp(typical(load_realism("lab")).latency.sense) == 0.0
    controller.reset(START, standing())
    for i in range(100):
        command = controller.command([standing()] * (i and controller.measurements))
    assert not command.stiffness.any() and not command.damping.any()
    belief = controller.state
    assert abs(belief.com[2] - robot().height_com) < 0.01 and abs(belief.com_vel).max() < 0.02


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("attitude", [2.0, 0.0, 0.0, 0.0], "length 1"),
        ("acceleration", [0.0, 0.0, np.nan], "3 finite"),
        ("contacts", [True], "2 finite"),
        ("joint_positions", {"knee": 0.0}, "abdomen_z"),
        ("ground_wrench", None, "6 finite"),
    ],
)
def test_a_wrong_measurement_is_named(field: str, value: object, said: str) -> None:
    controller = poise.load_standalone("momentum-qp", robot(), realism="lab")
    with invalid(field, said, source="measurement"):
        controller.reset(START, standing(**{field: value}))


def test_what_cannot_run_on_a_robot_is_refused() -> None:
    load = partial(poise.load_standalone, "momentum-qp", robot())
    with invalid("realism"):
        load(realism="ideal")
    with invalid("sensors.velocity_nois"):
        load(realism={"sensors": {"velocity_nois": 0.1}})
    agent = load_agent("momentum-qp", robot())
    agent.env.estimator = EstimatorConfig("exact")
    with invalid("estimator.kind", "odometry"):
        SensedController(agent, load_realism("lab"))
    controller = load(realism="lab")
    with pytest.raises(PoiseError, match="before reset"):
        controller.command()
    with invalid("measured"):
        controller.reset(START, [])
    controller.reset(START, standing())
    controller.command()
    with invalid("measured", str(controller.measurements), "not 1"):
        controller.command(standing())


@pytest.mark.parametrize("servo", [False, True])
def test_targets_give_the_same_torque(servo: bool) -> None:
    """At the readings it is that of the command; away from them the servo's own is added."""
    rng = np.random.default_rng(0)
    torque, target, q, dq = rng.normal(size=(4, 5))
    stiffness, damping = rng.uniform(1.0, 3.0, size=(2, 5)) if servo else np.zeros((2, 5))
    command = MotorCommand(torque, target, stiffness, damping)
    gain, brake = rng.uniform(10.0, 30.0, size=(2, 5))
    sent = command.targets(q, dq, gain, brake)

    def torques(c: MotorCommand, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return c.torque + c.stiffness * (c.target - q) - c.damping * dq

    np.testing.assert_allclose(torques(sent, q, dq), torques(command, q, dq), atol=1e-12)
    assert not sent.torque.any()
    moved = torques(sent, q + 0.1, dq + 0.2) - torques(sent, q, dq)
    own = (stiffness, damping) if servo else (gain, brake)
    np.testing.assert_allclose(moved, -0.1 * own[0] - 0.2 * own[1], atol=1e-12)


def test_targets_need_a_stiffness() -> None:
    command = MotorCommand(*np.zeros((4, 2)))
    with invalid("stiffness", "0"):
        command.targets(np.zeros(2), np.zeros(2), np.zeros(2), np.ones(2))
