"""envs/physics/legs.py and training/deploy/robot_check/standing/one_leg.py."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.config import SwingTask
from poise.envs.physics.legs import find_legs
from poise.envs.robots.robot import Robot, load_robot
from poise.training.deploy.robot_check.standing.one_leg import one_leg_qpos
from tests.support.small_biped import JOINTS, LEG, write_biped
from tests.support.small_urdf import write_urdf

STRAIGHT = {"joints": {"*_knee": 5}}  # the least of its range


def test_a_leg_is_what_moves_one_foot_alone(tmp_path: Path) -> None:
    """A waist above both hips is of neither leg; the knee is the middle one of three that pitch."""
    for leg, side in zip(find_legs(load_robot("toddler")), "LR", strict=True):
        assert leg.joints == tuple(f"{side}{j}" for j in ("HipRoll", "HipYaw", "HipPitch", "Knee",
                                                           "Ankle"))  # fmt: skip
        assert leg.knee == f"{side}Knee" and leg.ankle_pitch and not leg.ankle_roll
    for leg in find_legs(load_robot(write_biped(tmp_path))):
        assert leg.joints == tuple(f"{leg.foot}_{joint}" for joint in JOINTS)
        assert leg.ankle_pitch and leg.ankle_roll


@pytest.mark.parametrize("bend", [5, 30, 60])
def test_bend_is_that_of_the_knee(tmp_path: Path, bend: float) -> None:
    """Of a leg whose joints lie on a line where all are zero, the joint's own angle."""
    joints = {"*_hip": -bend / 2, "*_knee": bend, "*_ankle": -bend / 2}
    for leg in find_legs(load_robot(write_biped(tmp_path, posture={"joints": joints}))):
        assert leg.knee == f"{leg.foot}_knee"
        assert leg.knee_bend == pytest.approx(bend, abs=1e-6)


def test_a_leg_without_a_knee_and_an_ankle_of_one_axis(tmp_path: Path) -> None:
    """Two joints that pitch have none between them; a stiff ankle turns about nothing."""
    stiff = LEG.replace('<joint name="{side}_knee" axis="0 1 0" range="5 150"/>', "")
    stiff = stiff.replace('<joint name="{side}_ankle_roll" axis="1 0 0" range="-30 30"/>', "")
    path = write_biped(tmp_path, leg=stiff, extra="", torque_limits={"*": 50}, posture={})
    for leg in find_legs(load_robot(path)):
        assert (leg.knee, leg.knee_bend) == (None, None)
        assert leg.ankle_pitch and not leg.ankle_roll


def placed(robot: Robot, qpos: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
    """CoM, reference points and axes of the soles."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    axes = [data.xmat[s.body_id].reshape(3, 3) for s in robot.soles]
    points = [data.xpos[s.body_id] + R @ s.position for s, R in zip(robot.soles, axes, strict=True)]
    turns = [R @ s.rotation for s, R in zip(robot.soles, axes, strict=True)]
    return data.subtree_com[robot.root_body_id], points, turns


@pytest.mark.parametrize("stance", [0, 1])
def test_on_one_leg_the_com_is_over_that_foot(tmp_path: Path, stance: int) -> None:
    """The stance sole is where it was, the other lifted by a step's clearance, all in range."""
    robot = load_robot(write_urdf(tmp_path))
    qpos = one_leg_qpos(robot, stance)
    assert qpos is not None
    before, old, _ = placed(robot, robot.standing_qpos)
    com, new, turns = placed(robot, qpos)
    np.testing.assert_allclose(com[:2], [before[0], old[stance][1]], atol=1e-5)
    np.testing.assert_allclose(new[stance], old[stance], atol=1e-5)
    np.testing.assert_allclose(turns[stance], np.eye(3), atol=1e-5)
    lift = SwingTask().clearance * robot.height_com
    assert new[1 - stance][2] == pytest.approx(lift, abs=1e-5)
    low, high = robot.joint_range.T
    assert np.all((low <= qpos[7:]) & (qpos[7:] <= high))


def test_no_posture_on_one_leg(tmp_path: Path) -> None:
    """Without a joint that rolls above the ankle, whose range ends before the CoM is there."""
    leg = LEG.replace("-30 30", "-3 3")
    assert one_leg_qpos(load_robot(write_biped(tmp_path, leg=leg)), 0) is None
