"""envs/sensing/odometry.py: velocity of the root by legs and accelerometer."""

import copy

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.sensing.config import EstimatorConfig
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.odometry import LEAST, filter_gains, rate_gain
from tests.support.sensing import PLAIN, estimated, start
from tests.support.shared import robot

KINDS = "odometry", "inekf"
#: RMS of the velocity's error in the 0.3 s after a push [m/s]
BARS = {"lab": 0.03, "field": 0.06}


@pytest.fixture(scope="module", params=[(level, kind) for level in BARS for kind in KINDS])
def env(request: pytest.FixtureRequest) -> ResidualBalanceEnv:
    level, kind = request.param
    return ResidualBalanceEnv(robot(), realism=level, estimator=kind, pushes=None)


def velocity_errors(env: ResidualBalanceEnv, first: float, last: float) -> list[np.ndarray]:
    """The root's believed velocity over the true one, both of when it was measured [m/s]."""
    source, errors = env.state_source, []
    while env.simulation.time < last - 1e-9 and env.episode.running:
        env.step_without_info(np.zeros(env.action_space.shape))
        rings = source.sensors.rings
        row = rings.next - 1 - source.estimation.sense
        if env.simulation.time > first + 1e-9:
            errors.append(source.odometry.v[:3] - rings.truth_qvel[row, :3])
    return errors


def rms(errors: list[np.ndarray]) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=1))))


def test_velocity_is_known_in_quiet_standing(env):
    env.reset(seed=2)
    assert isinstance(env.state_source, EstimatedState) and env.drawn.measured
    assert rms(velocity_errors(env, 1.0, 2.0)) < BARS[env.realism.name]


def test_velocity_is_known_after_a_push(env):
    """Four pushes that the QP can take in the ideal world."""
    errors = []
    for k in range(4):
        push = {"impulse": 10.0, "direction": 90.0 * k + 20.0, "start": 1.0}
        env.reset(seed=20 + k, options={"push": push})
        errors += velocity_errors(env, 1.1, 1.4)
    assert rms(errors) < BARS[env.realism.name]


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


@pytest.mark.parametrize("noises", [(0.001, 0.2), (0.0005, 0.05), (0.0, 0.1), (0.001, 0.01)])
def test_joint_gains_are_those_of_a_filter_that_has_run_long(noises):
    """A Kalman recursion from a wide start."""
    dt, stir = 0.002, 15.0
    A, B = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[0.5 * dt * dt], [dt]])
    R, P = np.diag(np.maximum(noises, LEAST) ** 2.0), np.diag([1.0, 100.0])
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
    np.testing.assert_allclose(believed.qpos[3:7], true.qpos[3:7], atol=1e-9)


def test_raw_readings_are_not_filtered():
    """Of a controller that brings an estimator of its own: joints as they are read."""
    source = estimated("lab", 1, kind="odometry", predictor="none", filtered=False)
    for _ in range(10):
        source.simulation.step(np.zeros(robot().model.nu))
        source.update()
    rings, late = source.sensors.rings, source.estimation.sense
    row = rings.next - 1 - late
    assert late > 0
    np.testing.assert_allclose(source.odometry.q, rings.q[row], atol=1e-12)
    np.testing.assert_allclose(source.odometry.v[6:], rings.dq[row], atol=1e-12)
    np.testing.assert_allclose(source.odometry.v[3:6], rings.gyro[row], atol=1e-12)
    assert EstimatorConfig().filtered
