"""envs/sensing/inekf.py: errors on the group, against differences of the filter's own steps."""

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

from poise.envs.compiled.maths.vectors import skew
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.inekf import (
    Invariant,
    correct_error,
    find_sole,
    lead_on,
    see_attitude,
    see_sole,
)
from tests.support.physics import random_state
from tests.support.sensing import PLAIN, estimated, start
from tests.support.shared import robot

DT, G, N = 0.002, 9.81, 21
BIASES = slice(N - 6, N)


@pytest.fixture(scope="module")
def source() -> EstimatedState:
    return estimated(PLAIN, kind="inekf")


@pytest.fixture
def filter_(source: EstimatedState) -> Invariant:
    """A filter without noise in a generic state, with a generic covariance."""
    f, rng = source.invariant, np.random.default_rng(6)
    for name in ("gyro", "force", "gyro_walk", "force_walk", "attitude", "encoder", "kinematics"):
        setattr(f, name, 0.0)
    f.slide = f.roll = f.lift = 0.0
    root = rng.normal(size=(N, N))
    f.P[:] = root @ root.T / N
    chi = np.eye(7)
    chi[:3, :3], chi[:3, 3:] = Rotation.random(random_state=2).as_matrix(), rng.normal(size=(3, 4))
    put(f, chi, rng.normal(0.0, 0.2, 6))
    return f


def put(f: Invariant, chi: np.ndarray, biases: np.ndarray) -> None:
    """Set the state: χ (7, 7) in SE₄(3), columns R, v, p, d₁, d₂; b (6,)."""
    f.odometry.axes[:], f.place[:] = chi[:3, :3], chi[:3, 3:].T
    f.gyro_bias[:], f.force_bias[:] = biases[:3], biases[3:]


def get(f: Invariant) -> tuple[np.ndarray, np.ndarray]:
    chi = np.eye(7)
    chi[:3, :3], chi[:3, 3:] = f.odometry.axes, f.place.T
    return chi, np.r_[f.gyro_bias, f.force_bias]


def hat(xi: np.ndarray) -> np.ndarray:
    """(7, 7) of the algebra, for ξ (15,) = (ξ_R, ξ_v, ξ_p, ξ_d₁, ξ_d₂)."""
    out = np.zeros((7, 7))
    out[:3, :3], out[:3, 3:] = skew(xi[:3]), xi[3:].reshape(4, 3).T
    return out


def vee(matrix: np.ndarray) -> np.ndarray:
    return np.r_[matrix[2, 1], matrix[0, 2], matrix[1, 0], matrix[:3, 3:].T.ravel()]


def error(chi: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(15,) ξ with χ̂ χ⁻¹ = exp(ξ)."""
    return vee(np.real(logm(chi @ np.linalg.inv(other))))


def moved(chi: np.ndarray, biases: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The estimate whose error is e (21,) = (ξ, ζ)."""
    return expm(hat(e[:15])) @ chi, biases + e[15:]


def differences(f: Invariant, step, h: float = 1e-5) -> np.ndarray:
    """(m, 21) derivative of what `step` returns by the error of the estimate before it."""
    chi, biases, P = *get(f), f.P.copy()
    columns = []
    for e in np.eye(N):
        ends = []
        for sign in (h, -h):
            put(f, *moved(chi, biases, sign * e))
            f.P[:] = P
            ends.append(step())
        columns.append((ends[0] - ends[1]) / (2.0 * h))
    put(f, chi, biases)
    f.P[:] = P
    return np.array(columns).T


IMU = np.array([0.8, -1.5, 0.6]), np.array([1.0, -3.0, 11.0])


def test_the_covariance_is_led_on_by_the_errors_own_dynamics(filter_):
    """F P Fᵀ with F by differences on the group; noise of the IMU comes in as its biases do."""
    f = filter_
    chi, biases = get(f)
    lead_on(f, *IMU)
    after = get(f)
    put(f, chi, biases)

    def step() -> np.ndarray:
        lead_on(f, *IMU)
        led, kept = get(f)
        return np.r_[error(led, after[0]), kept - after[1]]

    F, P = differences(f, step), f.P.copy()
    f.gyro, f.force, f.gyro_walk, f.force_walk = 0.3, 0.7, 0.1, 0.2
    lead_on(f, *IMU)
    Q = np.diag(np.r_[np.zeros(15), 3 * [DT * 0.1**2], 3 * [DT * 0.2**2]])
    for columns, deviation in ((slice(15, 18), 0.3), (slice(18, 21), 0.7)):
        Q[:15, :15] += deviation**2 * F[:15, columns] @ F[:15, columns].T
    # (|ω| dt)²/12 = 1e-6 of what a bias turns, by the mean of R before and after
    np.testing.assert_allclose(f.P, F @ P @ F.T + Q, rtol=1e-5, atol=1e-8)
    assert abs(F - np.eye(N)).max() > 0.01


def test_the_mean_is_led_on_as_mujoco_moves_a_body(filter_):
    """Semi-implicit: the new rotation turns the force, the new velocity moves the root."""
    f = filter_
    (chi, b), (gyro, force) = get(f), IMU
    lead_on(f, gyro, force)
    R = chi[:3, :3] @ Rotation.from_rotvec(DT * (gyro - b[:3])).as_matrix()
    v = chi[:3, 3] + DT * (R @ (force - b[3:]) - [0.0, 0.0, G])
    expected = np.column_stack([R, v, chi[:3, 4] + DT * v, chi[:3, 5:]])
    np.testing.assert_allclose(get(f)[0][:3], expected, atol=1e-12)


def test_errors_are_led_on_linearly_however_large_they_are(filter_):
    """Without noise and error of the biases log(χ̂ χ⁻¹) obeys ξ_v ← ξ_v + g × ξ_R dt and
    ξ_p ← ξ_p + ξ_v dt exactly: half a radian and half a metre, 100 steps of any motion."""
    f, rng = filter_, np.random.default_rng(8)
    f.P[:] = 0.0
    chi, biases = get(f)
    xi = rng.uniform(-0.5, 0.5, 15)
    readings = rng.normal(0.0, [[3.0], [20.0]], (100, 2, 1)) * rng.normal(size=(100, 2, 3))
    ends = []
    for begin in (moved(chi, biases, np.r_[xi, np.zeros(6)])[0], chi):
        put(f, begin, biases)
        for gyro, force in readings:
            lead_on(f, gyro, force)
        ends.append(get(f)[0])
    for _ in readings:
        xi[3:6] += DT * np.cross([0.0, 0.0, -G], xi[:3])
        xi[6:9] += DT * xi[3:6]
    np.testing.assert_allclose(error(*ends), xi, atol=1e-9)


def test_an_attitude_is_of_the_rotations_error(filter_):
    f = filter_
    attitude, P = f.odometry.axes.copy(), f.P.copy()
    f.attitude = 0.1

    def step() -> np.ndarray:
        see_attitude(f, attitude)
        return f.z.copy()

    H = differences(f, step)
    np.testing.assert_allclose(H, np.eye(3, N), atol=1e-8)
    see_attitude(f, attitude)
    np.testing.assert_allclose(f.B, H @ P, atol=1e-8)


def test_a_sole_is_found_by_the_legs_joints(source):
    """From another posture's Jacobian, exactly: MuJoCo's kinematics of the measured one."""
    rng = np.random.default_rng(5)
    arrays, known = source.arrays, source.known
    for _ in range(3):
        known.reset(*random_state(robot(), rng))
        qpos = random_state(robot(), rng)[0]
        data = mujoco.MjData(robot().model)
        data.qpos[:] = qpos
        mujoco.mj_forward(robot().model, data)
        R = Rotation.from_quat(qpos[[4, 5, 6, 3]]).as_matrix()
        for i, body in enumerate(arrays.sole_body):
            sole = data.xpos[body] + data.xmat[body].reshape(3, 3) @ arrays.sole_position[i]
            find_sole(source.invariant, i, qpos[7:].copy())
            np.testing.assert_allclose(source.invariant.seen, R.T @ (sole - qpos[:3]), atol=1e-12)


@pytest.mark.parametrize("i", [0, 1])
def test_a_sole_is_of_the_difference_of_positions(filter_, i):
    """z = R̂ h − (d̂ − p̂) vanishes at the truth, and grows with ξ_p − ξ_d."""
    f = filter_
    f.odometry.rings.q[0] = f.odometry.state.qpos[7:] + 0.1
    find_sole(f, i, f.odometry.rings.q[0])
    f.soles[i] = f.position + f.odometry.axes @ f.seen
    f.encoder, f.kinematics = 0.001, 0.0005
    P = f.P.copy()

    def step() -> np.ndarray:
        see_sole(f, 0, i)
        return f.z.copy()

    expected = np.zeros((3, N))
    expected[:, 6:9], expected[:, 9 + 3 * i : 12 + 3 * i] = np.eye(3), -np.eye(3)
    H = differences(f, step)
    np.testing.assert_allclose(H, expected, atol=1e-7)
    chi = get(f)[0]
    see_sole(f, 0, i)
    assert abs(f.z).max() < 1e-12
    np.testing.assert_allclose(get(f)[0], chi, atol=1e-12)
    np.testing.assert_allclose(f.B, H @ P, atol=1e-6)


def test_a_correction_is_kalmans_on_the_group(filter_):
    """P by Joseph's form, χ by the exponential of the correction, biases by their difference."""
    f, rng = filter_, np.random.default_rng(9)
    H = np.zeros((3, N))
    H[:, 6:9], H[:, 12:15] = np.eye(3), -np.eye(3)
    noise, z = np.diag([0.1, 0.2, 0.3]) + 0.02, rng.normal(0.0, 0.3, 3)
    (chi, b), P = get(f), f.P.copy()
    f.noise[:], f.z[:] = noise, z
    correct_error(f, 6, 12)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + noise)
    joseph = (np.eye(N) - K @ H) @ P @ (np.eye(N) - K @ H).T + K @ noise @ K.T
    np.testing.assert_allclose(f.P, joseph, atol=1e-12)
    np.testing.assert_allclose(get(f)[0], expm(hat(-(K @ z)[:15])) @ chi, atol=1e-12)
    np.testing.assert_allclose(get(f)[1], b - (K @ z)[BIASES], atol=1e-12)


def test_the_covariance_stays_symmetric_and_positive():
    """In `field`, of a robot that stands, slides and falls: half a second without control."""
    source = estimated("field", 3, kind="inekf")
    P = source.invariant.P
    for _ in range(125):
        source.simulation.step(0.02 * robot().torque_limit, 2)
        source.update()
        assert np.array_equal(P, P.T)
        values = np.linalg.eigvalsh(P)
        assert values[0] > -1e-12 * values[-1]
    R = source.odometry.axes
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


def test_biases_are_found_by_a_robot_in_the_air():
    """The attitude tells the gyro's."""
    level = {"sensors": {"gyro_bias": 0.02, "tilt_drift": 0.0001, "gyro_noise": 0.001}}
    source = estimated(PLAIN, kind="inekf", invariant={"attitude": 0.001})
    qpos = robot().standing_qpos.copy()
    qpos[2] += 20.0
    drawn = start(source, level, 1, qpos)
    for _ in range(500):
        source.simulation.step(np.zeros(robot().model.nu))
        source.update()
    assert np.linalg.norm(drawn.gyro_bias) > 0.005
    np.testing.assert_allclose(source.invariant.gyro_bias, drawn.gyro_bias, atol=1e-3)
    true = source.simulation.state.qvel[3:6]
    np.testing.assert_allclose(source.state.qvel[3:6], true, atol=2e-3)
