"""The region over which motors hold a posture: its corners are what they can just bear."""

from dataclasses import replace

import numpy as np

from poise.baselines.motion.feasibility.split import bearable_region, joint_motor_torques
from poise.baselines.motion.feasibility.trajectory import PlantedRobot, sample_trajectory
from poise.envs.compiled.maths.polygons import half_planes
from tests.support.physics import robot_named


def test_corners_are_just_bearable() -> None:
    """With the weight over a corner no torque is over its limit by much, further out one is."""
    robot = robot_named("humanoid")
    planted, q = PlantedRobot(robot), robot.standing_qpos[7:]
    still = np.zeros_like(q)
    region = bearable_region(planted, q)
    path = sample_trajectory(planted, lambda _: (q, still, still), np.zeros(1))
    normals, offsets = half_planes(region)
    assert (offsets - normals @ path.com[0, :2]).min() > 0.03  # the CoM is well inside
    limit = np.asarray(robot.torque_limit)
    toe = region[np.argmax(region[:, 0])]
    shares = []
    for x in (toe[0] - 0.005, toe[0] + 0.02):
        moment = -(x - path.com[0, 0]) * robot.units.force
        leaned = path._replace(wrench=path.wrench + [[0.0, 0.0, 0.0, 0.0, moment, 0.0]])
        shares.append(np.abs(joint_motor_torques(robot, leaned) / limit).max())
    assert shares[0] < 1.0 < shares[1]
    assert toe[0] < path.support[:, 0].max() - 0.03  # the ankles give in before the soles tip


def test_weaker_motors_and_a_greater_load_make_it_smaller() -> None:
    robot = robot_named("humanoid")
    q = robot.standing_qpos[7:]
    weak = replace(robot, torque_limit=0.7 * np.asarray(robot.torque_limit))
    length = {
        "strong": np.ptp(bearable_region(PlantedRobot(robot), q)[:, 0]),
        "weak": np.ptp(bearable_region(PlantedRobot(weak), q)[:, 0]),
        "loaded": np.ptp(bearable_region(PlantedRobot(robot), q, 1.5)[:, 0]),
    }
    assert length["weak"] < 0.8 * length["strong"] and length["loaded"] < 0.8 * length["strong"]
    none = replace(robot, torque_limit=0.01 * np.asarray(robot.torque_limit))
    assert bearable_region(PlantedRobot(none), q) is None
