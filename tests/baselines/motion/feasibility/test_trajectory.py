"""The ground's wrench of a motion is what the momentum's change says."""

from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.feasibility.trajectory import PlantedRobot, joints_of, sample_trajectory
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named
from tests.support.robot_clips import com_clip


class Momentum(NamedTuple):
    """CoM [m], linear momentum and angular momentum about the CoM."""

    com: np.ndarray
    linear: np.ndarray
    angular: np.ndarray


def momentum(robot: Robot, before: np.ndarray, after: np.ndarray, step: float) -> Momentum:
    """MuJoCo's own, half way between two postures (nq,)."""
    data = mujoco.MjData(robot.model)
    mujoco.mj_differentiatePos(robot.model, data.qvel, step, before, after)
    data.qpos[:] = before
    mujoco.mj_integratePos(robot.model, data.qpos, data.qvel, 0.5 * step)
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    mujoco.mj_comVel(robot.model, data)
    mujoco.mj_subtreeVel(robot.model, data)
    root = robot.root_body_id
    return Momentum(
        data.subtree_com[root].copy(),
        robot.mass * data.subtree_linvel[root],
        data.subtree_angmom[root].copy(),
    )


def around(time: float) -> np.ndarray:
    """A way of the CoM that never rests [m]."""
    return np.array([0.02, 0.03, -0.02]) * np.sin(np.array([3.0, 4.0, 5.0]) * time)


@pytest.mark.parametrize(
    ("name", "motion"),
    [("humanoid", "squat"), ("humanoid", "bow"), ("humanoid", "arm_swing"), ("compact", "")],
)
def test_wrench_and_zmp_by_finite_differences(name: str, motion: str) -> None:
    """f = Ṗ − m g, n = L̇, at generic times; p is where a force alone would do."""
    robot, step = robot_named(name), 1e-4
    given = motion or reference_from(com_clip(robot, around, 3.0), robot, "test")
    planted, joints = PlantedRobot(robot), joints_of(load_motion(given, robot))
    times = np.random.default_rng(1).uniform(0.3, 2.5, 5)
    weight = np.array([0.0, 0.0, robot.units.force])
    for time in times:
        path = sample_trajectory(planted, joints, np.array([time]))
        places = [planted.placed(joints(time + k * step)[0]) for k in (-2, 0, 2)]
        first, second = (momentum(robot, *places[i : i + 2], 2 * step) for i in range(2))
        force = (second.linear - first.linear) / (2 * step) + weight
        moment = (second.angular - first.angular) / (2 * step)
        np.testing.assert_allclose(path.wrench[0, :3], force, atol=2e-3 * robot.units.force)
        np.testing.assert_allclose(path.wrench[0, 3:], moment, atol=0.05)
        arm = np.append(path.zmp[0], path.height) - path.com[0]
        tipping = np.cross(arm, force) - moment  # of a force at p about c, less what is needed
        np.testing.assert_allclose(tipping[:2], 0.0, atol=0.1)


def test_a_still_posture_has_its_zmp_under_the_com() -> None:
    robot = robot_named("humanoid")
    q = load_motion("squat", robot).sample(1.5).q_ref
    still = np.zeros_like(q)
    path = sample_trajectory(PlantedRobot(robot), lambda _: (q, still, still), np.zeros(1))
    np.testing.assert_allclose(path.zmp[0], path.com[0, :2], atol=1e-9)
    assert path.wrench[0, 2] == pytest.approx(robot.units.force)
    assert np.abs(path.wrench[0, :2]).max() < 1e-9
    assert not np.allclose(path.com[0, :2], 0.0, atol=1e-3)  # or nothing was tested


def test_a_vertical_sinusoid_loads_the_ground_by_its_acceleration() -> None:
    """f_z/(m g) = 1 − a ω² sin(ω t)/g for c_z = z₀ + a sin(ω t), ZMP where it was."""
    robot = robot_named("humanoid")
    amplitude, omega = -0.02, 2.0 * np.pi
    clip = com_clip(robot, lambda t: amplitude * np.sin(omega * t) * np.eye(3)[2], 3.0, 0.01)
    times = np.arange(0.5, 2.5, 0.05)
    motion = reference_from(clip, robot, "test")
    path = sample_trajectory(PlantedRobot(robot), joints_of(motion), times)
    load = 1.0 - amplitude * omega**2 * np.sin(omega * times) / robot.units.gravity
    np.testing.assert_allclose(path.wrench[:, 2] / robot.units.force, load, atol=2e-3)
    assert np.ptp(load) > 0.1


def test_soles_rest_while_the_joints_move() -> None:
    robot = robot_named("humanoid")
    motion = load_motion("squat", robot)
    path = sample_trajectory(PlantedRobot(robot), joints_of(motion), np.arange(0.5, 2.0, 0.1))
    speeds = np.einsum("kij,kj->ki", path.jacobians, path.qvel)
    assert np.abs(speeds).max() < 2e-3 < 0.1 < np.abs(path.qvel[:, 6:]).max()
