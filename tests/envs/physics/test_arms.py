"""The arms of a robot, and somebody else who moves them."""

import numpy as np
import pytest

from poise.envs.compiled.calls import run
from poise.envs.physics.arms import RATE, find_arms
from poise.envs.robots.robot import load_robot
from poise.envs.sensing.estimator import EstimatedState
from tests.support.refused import invalid
from tests.support.sensing import PLAIN, estimated, start
from tests.support.shared import robot
from tests.support.small_biped import write_biped

MOVED = {"motors": {"arms": 0.5}}


@pytest.fixture(scope="module")
def source() -> EstimatedState:
    return estimated(PLAIN)


def arm_motors() -> np.ndarray:
    joints = [joint for arm in find_arms(robot()) for joint in arm.joints]
    return np.flatnonzero(np.isin(robot().motor_dofs - 6, joints))


def moved(source: EstimatedState, level: dict, seed: int, torque: float = 0.0) -> np.ndarray:
    """(1500, n) angles of the arms' joints over 3 s of a robot that is held up by its root."""
    start(source, level, seed)
    simulation, found, asked = source.simulation, [], np.zeros(robot().model.nu)
    dofs = robot().motor_dofs[arm_motors()]
    asked[arm_motors()] = torque * robot().torque_limit[arm_motors()]
    for _ in range(1500):
        simulation.step(asked)
        simulation.data.qpos[:7], simulation.data.qvel[:6] = robot().standing_qpos[:7], 0.0
        found.append(simulation.data.qpos[dofs + 1].copy())
    return np.array(found)


def test_arms_are_all_that_shoulders_carry():
    left, right = find_arms(robot())
    names = robot().joint_names
    assert [names[j] for j in left.joints] == ["left_shoulder1", "left_shoulder2", "left_elbow"]
    assert [names[j] for j in right.joints] == ["right_shoulder1", "right_shoulder2", "right_elbow"]
    hands = [robot().model.body(arm.hand).name for arm in (left, right)]
    assert hands == ["left_lower_arm", "right_lower_arm"]


def test_what_a_controller_asks_of_arms_is_replaced(source):
    """By a servo with the joint's own inertia; the legs do what they are asked."""
    start(source, MOVED)
    simulation, arms, asked = source.simulation, arm_motors(), 0.3 * robot().torque_limit
    for _ in range(300):
        simulation.step(asked)
    views, data, dofs = simulation.views, simulation.data, robot().motor_dofs
    views.ctrl[:] = asked
    run(source.drive)
    acting = views.ctrl + views.qfrc_applied[dofs]
    legs = np.setdiff1d(np.arange(len(dofs)), arms)
    np.testing.assert_allclose(acting[legs], asked[legs], rtol=1e-12)
    a, q, dq = source.arms, data.qpos[dofs[arms] + 1], data.qvel[dofs[arms]]
    u = (a.step - 1) % a.period / a.period
    target = a.last + (a.goal - a.last) * (10 * u**3 - 15 * u**4 + 6 * u**5)
    servo = a.inertia * (RATE**2 * (target - q) - 2.0 * RATE * dq)
    limit = robot().torque_limit[arms]
    np.testing.assert_allclose(acting[arms], np.clip(servo, -limit, limit), rtol=1e-9)
    assert abs(acting[arms] - asked[arms]).min() > 1e-3


def test_arms_move_alike_whatever_is_asked(source):
    """Within half of the way to their limits, the same for one seed, another way for another."""
    ways = moved(source, MOVED, 1)
    assert np.array_equal(ways, moved(source, MOVED, 1))
    np.testing.assert_allclose(ways, moved(source, MOVED, 1, torque=0.3), atol=1e-6)
    assert np.max(abs(ways - moved(source, MOVED, 2))) > 0.2
    stand, joints = source.arms.stand, robot().motor_dofs[arm_motors()] - 6
    half = stand[:, None] + 0.5 * (robot().joint_range[joints] - stand[:, None])
    slack = 0.3  # [rad] by which gravity pulls a servo off its target
    assert np.all(ways > half[:, 0] - slack) and np.all(ways < half[:, 1] + slack)
    assert np.ptp(ways, axis=0).min() > 0.2


def test_nobody_moves_them_where_it_is_not_asked(source):
    start(source, PLAIN)
    asked = 0.1 * robot().torque_limit
    for _ in range(3):
        source.simulation.step(asked)
        assert not np.any(source.simulation.views.qfrc_applied)


def test_a_robot_without_arms_is_refused(tmp_path):
    biped = load_robot(write_biped(tmp_path))
    assert find_arms(biped) == ()
    from poise.envs.balance.torque import TorqueBalanceEnv

    for level in (MOVED, {"body": {"hand": 0.05}}):
        field = "motors.arms" if level is MOVED else "body.hand"
        with invalid(field, "shoulder_pitch_left", source="custom"):
            TorqueBalanceEnv(biped, realism=level)
