"""Robot → BVH → robot: angles and places come back through a file of six decimals."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.link_groups import GROUPS
from poise.baselines.motion.retargeting.robot_bvh import clip_of_robot, robot_qpos
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named

ROBOTS = ("humanoid", "compact", "tall", "toddler")
POSES = 100


def random_poses(robot: Robot, count: int) -> np.ndarray:
    """Postures anywhere within the joint limits, with any place and orientation of the root."""
    rng = np.random.default_rng(0)
    low, high = np.clip(robot.joint_range, -np.pi, np.pi).T
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return np.concatenate([rng.uniform(-2, 2, (count, 3)), turns,
                           rng.uniform(low, high, (count, len(low)))], axis=1)  # fmt: skip


@pytest.mark.parametrize("name", ROBOTS)
def test_poses_come_back_through_a_file(name: str, tmp_path: Path) -> None:
    robot = robot_named(name)
    qpos, path = random_poses(robot, POSES), tmp_path / "robot.bvh"
    write_bvh(clip_of_robot(robot, qpos, 0.02, name), path)
    again = robot_qpos(read_bvh(path, "m", "y", "z").clip, robot)
    assert np.abs(again[:, 7:] - qpos[:, 7:]).max() < 1e-6
    assert np.abs(again[:, :3] - qpos[:, :3]).max() < 1e-6
    assert np.abs(np.abs((again[:, 3:7] * qpos[:, 3:7]).sum(axis=1)) - 1.0).max() < 1e-12


def test_the_skeleton_s_joints_are_where_the_hinges_are() -> None:
    robot = robot_named("humanoid")
    qpos, data = random_poses(robot, 5), mujoco.MjData(robot.model)
    places = clip_of_robot(robot, qpos, 0.02, "poses").places()
    for pose, found in zip(qpos, places, strict=True):
        data.qpos[:] = pose
        mujoco.mj_kinematics(robot.model, data)
        assert np.abs(found[1:] - data.xanchor[1:]).max() < 1e-9


def test_what_no_robot_can_do_is_refused() -> None:
    robot, other = robot_named("compact"), robot_named("humanoid")
    clip = clip_of_robot(robot, random_poses(robot, 3), 0.02, "poses")
    with pytest.raises(ConfigError, match="poses: has no joint 'torso' of the robot 'humanoid'"):
        robot_qpos(clip, other)
    rotations = clip.rotations.copy()
    rotations[1, 4] = [0.5, 0.5, 0.5, 0.5]
    bent = type(clip)("bent", clip.skeleton, clip.dt, clip.root, rotations)
    with pytest.raises(ConfigError, match="beside its axis in frame 1"):
        robot_qpos(bent, robot)


@pytest.mark.parametrize("name", ROBOTS)
def test_limbs_are_roles_of_the_skeleton(name: str) -> None:
    """So groups of links are found, and the standing robot faces x."""
    robot = robot_named(name)
    clip = clip_of_robot(robot, np.repeat(robot.standing_qpos[None], 2, axis=0), 0.02, name)
    legs = GROUPS["legs"].joints(clip.skeleton)
    hinges = {clip.skeleton.names.index(joint) for joint in robot.joint_names}
    assert set(legs) <= hinges and len(legs) >= 8
    assert not set(legs) & set(GROUPS["arms"].joints(clip.skeleton))
    assert clip.facing() == pytest.approx(0.0, abs=1e-6)
