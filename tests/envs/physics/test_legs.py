"""How far feet can be turned from the trunk."""

import mujoco
import numpy as np
import pytest

from poise.envs.physics.legs import turn_range
from poise.envs.robots.robot import load_robot
from tests.support.shared import robot
from tests.support.small_biped import write_biped


def yaw_of(body, data, side):
    """The heading of a foot [rad]; the robot faces along x."""
    ahead = data.body(f"{side}_foot").xmat.reshape(3, 3)[:, 0]
    return np.arctan2(ahead[1], ahead[0])


def test_feet_turn_as_far_as_the_joints_about_the_vertical_let_both_of_them():
    """Beside the feet themselves, with the joint of each leg at its ends."""
    body = robot("humanoid")
    data, turns = mujoco.MjData(body.model), []
    for side in ("left", "right"):
        joint, found = body.model.joint(f"{side}_hip_z"), []
        for end in joint.range:
            data.qpos[:] = body.standing_qpos
            data.qpos[joint.qposadr[0]] = end
            mujoco.mj_kinematics(body.model, data)
            found.append(yaw_of(body, data, side))
        turns.append(sorted(found))
    (left_low, left_high), (right_low, right_high) = turns
    low, high = turn_range(body)
    assert low == pytest.approx(max(left_low, right_low), abs=0.02)
    assert high == pytest.approx(min(left_high, right_high), abs=0.02)
    assert low < -0.5 and high == pytest.approx(-low)  # legs are mirror images


def test_legs_without_such_a_joint_do_not_turn(tmp_path):
    assert turn_range(load_robot(write_biped(tmp_path))) == (0.0, 0.0)
