"""Getting up: the servos' law, the scripts that are played where, and standing in the end."""

import numpy as np
import pytest

from poise.baselines.balance.in_place.get_up import GRACE, GetUp, GetUpConfig, Key
from poise.baselines.controller import Targets
from poise.baselines.registry import controller_config, load_controller
from poise.envs.balance.fallen import fallen_posture
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.rising import is_up
from tests.support.refused import invalid

ROBOT = load_robot()


def facing(number: int) -> tuple[float, float]:
    """How far the front and the left of a fallen robot look up."""
    axes = Simulation(ROBOT).reset(fallen_posture(ROBOT, number)).root_axes
    return float(axes[2, 0]), float(axes[2, 1])


def first(wanted) -> int:
    return next(n for n in range(600, 700) if wanted(*facing(n)))


def made() -> GetUp:
    controller = load_controller("get-up", ROBOT)
    assert isinstance(controller, GetUp)
    return controller


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("back", lambda ahead, left: ahead > 0.9),
        ("front", lambda ahead, left: ahead < -0.95),
        ("right side", lambda ahead, left: left > 0.8),
        ("left side", lambda ahead, left: left < -0.8),
    ],
)
def test_it_stands_up_from_everywhere(name: str, wanted) -> None:
    agent = load_agent("get-up", ROBOT, duration=9.0, pushes=None, fall={"terminates": False})
    env = agent.env
    env.reset(seed=0, options={"fallen": first(wanted)})
    assert not is_up(env)
    for _ in range(450):
        env.step(np.zeros(env.action_space.shape))
    assert is_up(env) and env.simulation.state.com_vel[2] == pytest.approx(0.0, abs=0.05)


def test_standing_it_is_the_momentum_qp() -> None:
    simulation = Simulation(ROBOT)
    state = simulation.reset(ROBOT.standing_qpos.copy())
    both = made(), load_controller("momentum-qp", ROBOT)
    for controller in both:
        controller.reset(state)
    targets = Targets.standing(ROBOT, state)
    mine, other = (controller.torques(state, targets) for controller in both)
    np.testing.assert_array_equal(mine, other)
    np.testing.assert_array_equal(both[0].torques(state, targets), other)  # held for a tick of 4 ms


def test_the_servo_is_as_slow_as_an_implicit_one() -> None:
    """At the first posture of `lie` and at rest in it: no torque; off it K e/(1 + Δt D/M)."""
    controller = made()
    state = Simulation(ROBOT).reset(fallen_posture(ROBOT, first(lambda a, b: a > 0.9)))
    controller.reset(state)
    assert controller.stage == "lie"
    posture = controller.scripts["lie"][0][1]
    controller.start = state.q - 0.01
    own = state.M.diagonal()[6:]
    inertia = 1.0 + controller.period * controller.damping / own
    expected = controller.stiffness * (controller.start - state.q)
    expected = (expected - controller.damping * state.qvel[6:]) / inertia
    tau = controller.torques(state, Targets.standing(ROBOT, state))
    motors = controller.arrays.motor_dofs - 6
    limit = ROBOT.torque_limit
    np.testing.assert_allclose(tau, np.clip(expected[motors], -limit, limit), atol=1e-9)
    assert posture.shape == state.q.shape


def test_turns_are_mirrored() -> None:
    """From the left side with the joints of left and right exchanged."""
    scripts = []
    for sign in (1.0, -1.0):
        controller = made()
        number = first(lambda a, left, sign=sign: left * sign > 0.8)
        state = Simulation(ROBOT).reset(fallen_posture(ROBOT, number))
        controller.reset(state)
        controller._play("side", state)
        scripts.append(controller.script[0][1])
    left, right = scripts
    names = list(ROBOT.joint_names)
    for mine, other in (("left_knee", "right_knee"), ("right_hip_y", "left_hip_y")):
        assert left[names.index(mine)] == pytest.approx(right[names.index(other)])
    assert left[names.index("abdomen_z")] == pytest.approx(-right[names.index("abdomen_z")])


def test_a_fall_while_standing_is_seen_and_a_joint_that_is_not_there() -> None:
    controller = made()
    state = Simulation(ROBOT).reset(ROBOT.standing_qpos.copy())
    controller.reset(state)
    assert controller.stage == "balance" and controller.clock >= GRACE
    lying = Simulation(ROBOT).reset(fallen_posture(ROBOT, 600))
    controller.torques(lying, Targets.standing(ROBOT, lying))
    assert controller.stage == "lie"
    with invalid("tail"):
        GetUp(ROBOT, GetUpConfig(lie=(Key(joints={"tail": 3.0}),)))
    assert isinstance(controller_config("get-up"), GetUpConfig)
