"""Where the centre of mass and root of a posture are when the soles lie on the ground."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.postures import LevelKinematics
from poise.envs.robots.robot import load_robot


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


def test_standing_posture(robot):
    """Standing, the height is the robot's own and the root is where standing_qpos has it."""
    standing = LevelKinematics(robot).standing
    assert standing.com[2] == pytest.approx(robot.height_com, abs=1e-6)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    np.testing.assert_allclose(standing.com, data.subtree_com[robot.root_body_id], atol=1e-6)
    axes = data.xmat[robot.root_body_id].reshape(3, 3)
    np.testing.assert_allclose(standing.root_axes, axes, atol=1e-6)


def test_root_pose_of_the_data_does_not_matter(robot):
    """The result is that of the robot whose root is placed so that the soles are level."""
    kinematics = LevelKinematics(robot)
    q = robot.standing_qpos[7:].copy()
    ankles = [i for i, name in enumerate(robot.joint_names) if name.endswith("ankle_y")]
    q[ankles] += 0.2  # both ankles: the body leans back by 0.2 rad about the soles
    leaning = kinematics.posture(q)
    np.testing.assert_allclose(kinematics.root_rotation(leaning), [0.0, -0.2, 0.0], atol=1e-9)

    data = mujoco.MjData(robot.model)
    data.qpos[7:] = q
    data.qpos[:3] = 1.0, 2.0, 3.0
    turn = Rotation.from_euler("y", -0.2) * Rotation.from_matrix(kinematics.standing.root_axes)
    data.qpos[3:7] = turn.as_quat()[[3, 0, 1, 2]]
    mujoco.mj_forward(robot.model, data)
    soles = [
        data.xpos[s.body_id] + data.xmat[s.body_id].reshape(3, 3) @ s.position for s in robot.soles
    ]
    com = data.subtree_com[robot.root_body_id] - np.mean(soles, axis=0)
    np.testing.assert_allclose(leaning.com, com, atol=1e-9)


def test_support_extent_of_the_humanoid(robot):
    """Soles of 0.26 m × 0.08 m with centres 0.18 m apart."""
    np.testing.assert_allclose(LevelKinematics(robot).support_extent(), [0.13, 0.13], atol=1e-3)


def test_root_rotation_is_relative_to_the_standing_root(robot):
    """exp(φ) · standing root_axes = root_axes, also for a root frame that is not upright."""
    kinematics = LevelKinematics(robot)
    standing = Rotation.from_euler("zx", [0.7, 1.2])
    phi = np.array([0.1, -0.3, 0.2])
    posture = kinematics.standing._replace(
        root_axes=(Rotation.from_rotvec(phi) * standing).as_matrix()
    )
    kinematics.standing = kinematics.standing._replace(root_axes=standing.as_matrix())
    np.testing.assert_allclose(kinematics.root_rotation(posture), phi, atol=1e-12)
