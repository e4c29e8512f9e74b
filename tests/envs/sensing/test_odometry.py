"""envs/sensing/odometry.py: velocity of the root by legs and accelerometer."""

import copy

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.sensing.estimator import EstimatedState, EstimatorConfig
from poise.envs.sensing.odometry import filter_gains, rate_gain
from tests.support.sensing import PLAIN, estimated, start
from tests.support.shared import robot

KINDS = ("odometry",)
#: of the QP's standing robot, that nobody pushes; what is asked for after a push is 0.03 and 0.06
BARS = {"lab": 0.03, "field": 0.06}


@pytest.fixture(scope="module", params=BARS)
def standing(request: pytest.FixtureRequest) -> ResidualBalanceEnv:
    """One second of standing in a level, in the midst of it."""
    env = ResidualBalanceEnv(robot(), realism=request.param, pushes=None)
    env.reset(seed=2)
    for _ in range(50):
        env.step_without_info(np.zeros(env.action_space.shape))
    return env


def velocity_error(env: ResidualBalanceEnv, steps: int) -> float:
    """RMS of the root's believed velocity when it was measured [m/s]."""
    source, squares = env.state_source, []
    for _ in range(steps):
        env.step_without_info(np.zeros(env.action_space.shape))
        rings = source.sensors.rings
        row = rings.next[0] - 1 - source.belief.steps[0]
        squares.append(np.sum((source.odometry.v[:3] - rings.truth_qvel[row, :3]) ** 2))
    return float(np.sqrt(np.mean(squares)))


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_is_known_in_quiet_standing(standing, kind):
    level = standing.realism.name
    source = standing.state_source
    assert isinstance(source, EstimatedState) and standing.drawn.measured
    assert velocity_error(standing, 50) < BARS[level]


@pytest.mark.parametrize("kind", ["exact", *KINDS])
def test_no_estimator_reads_what_no_sensor_gives(kind):
    """Shift where the robot truly is and how fast: only `exact` believes it."""
    source = estimated("lab", 1, kind=kind)
    for _ in range(30):
        source.simulation.step(np.zeros(robot().model.nu))
    twin = copy.deepcopy(source)
    twin.sensors.rings.truth_qpos[:, :3] += 0.5
    twin.sensors.rings.truth_qpos[:, 7:] += 0.1
    twin.sensors.rings.truth_qvel[:] += 0.3
    for each in (source, twin):
        each.update()
    one, other = source.state, twin.state
    equal = np.array_equal(one.qpos, other.qpos) and np.array_equal(one.qvel, other.qvel)
    assert equal == (kind != "exact")
    assert np.any(one.qvel)


@pytest.mark.parametrize("noises", [(0.001, 0.2), (0.0005, 0.05), (0.0, 0.1), (0.001, 0.0)])
def test_joint_gains_are_those_of_a_filter_that_has_run_long(noises):
    """A Kalman recursion from a wide start."""
    dt, stir = 0.002, 15.0
    A, B = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[0.5 * dt * dt], [dt]])
    R, P = np.diag(np.maximum(noises, 1e-6) ** 2.0), np.diag([1.0, 100.0])
    for _ in range(20_000):
        P = A @ P @ A.T + stir**2 * B @ B.T + 1e-18 * np.eye(2)
        K = P @ np.linalg.inv(P + R)
        P = (np.eye(2) - K) @ P
    np.testing.assert_allclose(filter_gains(dt, stir, *noises), K, rtol=1e-5, atol=1e-9)


def test_the_rate_gain_is_that_of_a_filter_that_has_run_long():
    dt, stir, noise = 0.002, 5.0, 0.05
    P = 1.0
    for _ in range(5000):
        P += (stir * dt) ** 2
        gain = P / (P + noise**2)
        P *= 1.0 - gain
    assert rate_gain(dt, stir, noise) == pytest.approx(gain, rel=1e-9)
    assert rate_gain(dt, stir, 0.0) == pytest.approx(1.0, abs=1e-6)


def test_perfect_sensors_give_the_true_motion():
    """Of a robot that falls from a height: its accelerometer alone tells how fast."""
    source = estimated(PLAIN, kind="odometry")
    qpos = robot().standing_qpos.copy()
    qpos[2] += 0.5
    start(source, PLAIN, 0, qpos)
    for _ in range(100):
        source.simulation.step(0.05 * robot().torque_limit)
        source.update()
    true, believed = source.simulation.state, source.state
    assert true.qvel[2] < -1.5
    np.testing.assert_allclose(believed.qvel[:3], true.qvel[:3], atol=1e-3)
    np.testing.assert_allclose(believed.qpos[3:], true.qpos[3:], atol=1e-3)


def test_raw_readings_are_not_filtered():
    """Of a controller that brings an estimator of its own: joints as they are read."""
    source = estimated("lab", 1, kind="odometry", predictor="none", filtered=False)
    for _ in range(10):
        source.simulation.step(np.zeros(robot().model.nu))
        source.update()
    rings, late = source.sensors.rings, source.belief.steps[0]
    row = rings.next[0] - 1 - late
    assert late > 0 and np.array_equal(source.odometry.q, rings.q[row])
    assert np.array_equal(source.odometry.v[6:], rings.dq[row])
    assert np.array_equal(source.odometry.v[3:6], rings.gyro[row])
    assert EstimatorConfig().filtered
