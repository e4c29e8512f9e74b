"""Legs that reach planted soles, and how they change with the trunk."""

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.references.motion import load_motion
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named


def test_a_motions_own_postures_are_found_again() -> None:
    robot = robot_named("humanoid")
    legs, motion = PlantedLegs(robot), load_motion("squat", robot)
    q = robot.standing_qpos[7:]
    for time in np.arange(0.0, 2.0, 0.1):
        s = motion.sample(time)
        qpos, error = legs.reach(s.com_offset, s.root, s.q_ref[legs.others], q)
        q = qpos[7:]
        assert error < 1e-6
        np.testing.assert_allclose(q, s.q_ref, atol=5e-3)  # its CoM is a spline of its own


@pytest.mark.parametrize("name", ["tall", "compact"])
def test_soles_stay_and_the_com_is_where_it_is_to_be(name: str) -> None:
    robot = robot_named(name)
    legs, s = PlantedLegs(robot), load_motion("standing", robot).sample(0.0)
    way = np.array([0.03, -0.02, -0.04])
    qpos, error = legs.reach(s.com_offset + way, s.root, s.q_ref[legs.others], s.q_ref)
    assert error < 1e-6
    before, after = (_places(robot, q) for q in (robot.standing_qpos, qpos))
    np.testing.assert_allclose(after[0] - before[0], way, atol=1e-6)
    np.testing.assert_allclose(after[1], before[1], atol=1e-6)


def test_what_legs_cannot_reach_is_told() -> None:
    robot = robot_named("humanoid")
    legs, s = PlantedLegs(robot), load_motion("standing", robot).sample(0.0)
    _, error = legs.reach(s.com_offset + [0.0, 0.0, 0.3], s.root, s.q_ref[legs.others], s.q_ref)
    assert error > 0.05


def test_sensitivity_by_finite_differences() -> None:
    robot, step = robot_named("humanoid"), 1e-5
    legs, s = PlantedLegs(robot), load_motion("squat", robot).sample(1.2)
    com, root = s.com_offset + [0.01, 0.02, 0.0], s.root + [0.1, 0.2, -0.05]

    def reached(change: np.ndarray) -> np.ndarray:
        moved = com + change[:3], root + change[3:]
        return legs.reach(*moved, s.q_ref[legs.others], s.q_ref)[0][7 + legs.legs]

    reached(np.zeros(6))
    slopes = legs.sensitivity(root)
    for i, axis in enumerate(np.eye(6)):
        change = (reached(step * axis) - reached(-step * axis)) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, i], change, rtol=1e-3, atol=1e-3)
    assert np.abs(slopes).max() > 1.0


def _places(robot: Robot, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """CoM and feet."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    feet = [sole.body_id for sole in robot.soles]
    return data.subtree_com[robot.root_body_id].copy(), data.xpos[feet].copy()
