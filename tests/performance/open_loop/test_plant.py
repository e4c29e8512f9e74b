"""Windows of simulation: from any state the same bits, and errors that mean what they say."""

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.motion import MotionDescription, load_motion, make_motion
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.robots.robot import Robot, load_robot
from tests.performance.open_loop.plant import FALLEN, Plant
from tests.performance.open_loop.search import replay

RNG = np.random.default_rng(0)
BEND = {"knees": 20, "hips_pitch": -10, "ankles_pitch": -10}
SHORT = {
    "keyframes": [{"time": 0.0}, {"time": 0.35, "roles": BEND}, {"time": 0.7}],
    "balance": {"forward": {"ankles_pitch": 1}},
}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture(scope="module")
def plant(robot: Robot) -> Plant:
    return short_plant(robot)


def short_plant(robot: Robot, window: float = 0.1) -> Plant:
    description = build(MotionDescription, SHORT, "short.yaml")
    return Plant(robot, make_motion(description, robot, "short", "short.yaml"), window)


def test_windows_cover_the_motion_and_arms_have_no_offsets(plant: Plant, robot: Robot) -> None:
    assert (plant.windows, plant.steps, plant.size) == (7, 50, 15)
    arms = [i for i, name in enumerate(robot.joint_names) if "shoulder" in name or "elbow" in name]
    assert not set(arms) & set(plant.moved)


def test_a_state_is_all_that_matters(plant: Plant) -> None:
    """The same window from the same state, with others in between, gives the same bits."""
    offsets = 0.05 * RNG.normal(size=(3, plant.size))
    first = plant.play(plant.start(), 0, offsets[0])
    second = plant.play(first.state, 1, offsets[1])
    plant.play(first.state, 1, offsets[2])
    again = plant.play(first.state, 1, offsets[1])
    assert np.array_equal(again.state, second.state) and again[1:] == second[1:]


def test_two_windows_are_one_of_twice_the_time(plant: Plant, robot: Robot) -> None:
    long, offset = short_plant(robot, 0.2), 0.05 * RNG.normal(size=plant.size)
    whole = long.play(long.start(), 0, offset)
    first = plant.play(plant.start(), 0, offset)
    second = plant.play(first.state, 1, offset)
    assert np.array_equal(whole.state, second.state)
    assert whole.error == pytest.approx(first.error + second.error)
    assert whole.upright == pytest.approx(first.upright + second.upright) == pytest.approx(0.2)


def test_simulated_time_is_counted(robot: Robot) -> None:
    plant = short_plant(robot)
    replay(plant, np.zeros((7, plant.size)))
    assert plant.simulated == pytest.approx(0.7)


def test_the_reference_has_no_error_and_what_leaves_it_has(plant: Plant, robot: Robot) -> None:
    """Standing at the start; then a joint, the root and the CoM's velocity are put off."""
    plant.start()
    assert plant.error(0) == pytest.approx(0.0, abs=1e-9)
    elbow = 7 + robot.joint_names.index("right_elbow")
    plant.data.qpos[elbow] += 0.3
    mujoco.mj_forward(plant.model, plant.data)
    joints = 0.3**2 / len(robot.joint_names)
    assert plant.error(0) == pytest.approx(joints, rel=0.1)
    plant.start(0.2)
    mujoco.mj_forward(plant.model, plant.data)
    assert plant.error(0) == pytest.approx(10.0 * (0.2 / robot.omega) ** 2, rel=1e-6)


def test_targets_are_those_of_the_motion_and_the_offset(plant: Plant) -> None:
    """With the body at the targets there is no torque; an offset gives K δ within the limits."""
    plant.start()
    plant._act(0, np.zeros(len(plant.stiffness)))
    assert plant.data.ctrl == pytest.approx(0.0, abs=1e-9)
    shift = np.zeros(len(plant.stiffness))
    shift[plant.moved[0]] = 1e-3
    plant._act(0, shift)
    torque = plant.data.ctrl[list(plant.motors).index(plant.moved[0])]
    assert torque == pytest.approx(1e-3 * plant.stiffness[plant.moved[0]])
    plant._act(0, 1e3 * shift)
    assert np.all(np.abs(plant.data.ctrl) <= plant.robot.torque_limit)


def test_a_fall_ends_the_count(robot: Robot) -> None:
    """Without offsets servos do not keep a squat up; what is left of the motion is an error."""
    plant = Plant(robot, load_motion("squat", robot))
    fallen = replay(plant, np.zeros((plant.windows, plant.size)))
    assert 1.0 < fallen.upright < 3.0 and plant.simulated < fallen.upright + 0.1
    assert fallen.error > 0.9 * FALLEN * (plant.windows * 0.1 - fallen.upright)


def test_a_window_is_of_whole_steps(robot: Robot) -> None:
    with pytest.raises(ConfigError, match="window"):
        short_plant(robot, 0.0333)
