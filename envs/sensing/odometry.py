"""The state of a robot from an IMU, encoders and soles, by its legs and its accelerometer."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from scipy.linalg import solve_discrete_are

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .config import EstimatorConfig
from .measurement import Rings
from .promises import Promises

LEAST = 1e-5, 1e-2  # noises of a joint's position and velocity [rad, rad/s]
START_SPEED = 0.1  # [m/s] of a robot that is thought to rest


@dataclass(eq=False)
class Odometry(Block):
    """What is remembered of a robot (nj joints, nc soles), as of the last measurement."""

    robot: RobotArrays
    state: StateArrays  # the estimate of the tick before: its Jacobians are used here
    rings: Rings
    promises: Promises
    seen: Mutable[int]  # measurements that have been used
    position: Annotated[np.ndarray, 3]  # of the root [m]
    axes: Annotated[np.ndarray, 3, 3]  # of the root
    q: Annotated[np.ndarray, "nj"]  # [rad]
    v: Annotated[np.ndarray, "nv"]  # velocity: root's in world axes, its angular one, joints'
    bias: Annotated[np.ndarray, 3]  # of the accelerometer and the attitude, world axes [m/s²]
    var_v: Mutable[float]  # variance of a component of the root's v [m²/s²]
    cov_vb: Mutable[float]  # its covariance with the same component of the bias
    var_b: Mutable[float]  # variance of that
    pressed: Annotated[np.ndarray, "nc", 2]  # where each sole is pressed [m]
    share: Annotated[np.ndarray, "nc"]  # of the load, that each sole bears
    sole_v: Annotated[np.ndarray, 6]  # velocity of a sole relative to a resting root [m/s, rad/s]
    gains: Annotated[np.ndarray, 2, 2]  # rows q, q̇: corrections by errors of q and q̇
    acceleration_noise: Mutable[float]  # of an error from step to step [m/s²]
    bias_walk: Mutable[float]  # see `EstimatorConfig` for this and the next two
    slip: Mutable[float]
    roll_radius: Mutable[float]
    rate_noise: Mutable[float]  # of the joints' velocities [rad/s]
    rate_gain: Mutable[float]  # correction of the root's angular velocity


def begin_odometry(o: Odometry, noises: dict[str, float], c: EstimatorConfig) -> None:
    """Start where the robot was for long: what was measured there is averaged.

    `noises` are the sensors' deviations by the names of `SensorErrors`.
    """
    r, dt = o.rings, o.robot.timestep
    o.promises.clear()
    o.seen = 1
    o.position[:] = r.truth_qpos[0, :3]
    o.axes[:] = r.attitude[r.next - 1]
    o.q[:], o.v[:] = r.q.mean(axis=0), 0.0
    o.v[3:6], o.v[6:] = r.gyro.mean(axis=0), r.dq.mean(axis=0)
    o.bias[:] = 0.0
    o.var_v, o.cov_vb, o.var_b = START_SPEED**2, 0.0, c.bias**2
    o.acceleration_noise = np.hypot(c.acceleration, noises["accelerometer_noise"])
    o.bias_walk, o.slip, o.roll_radius = c.bias_walk, c.slip, c.roll_radius
    q_noise, v_noise = noises["encoder_noise"], noises["velocity_noise"]
    o.rate_noise = v_noise
    if c.filtered:
        o.gains[:] = filter_gains(dt, c.joint_acceleration, q_noise, v_noise)
        o.rate_gain = rate_gain(dt, c.turn_acceleration, noises["gyro_noise"])
    else:
        o.gains[:], o.rate_gain = np.eye(2), 1.0


@lru_cache(maxsize=256)  # a Riccati equation at each reset would take most of it
def filter_gains(dt: float, acceleration: float, noise_q: float, noise_v: float) -> np.ndarray:
    """(2, 2) gains of the stationary Kalman filter of a joint, whose state is (q, q̇).

    An unmodelled acceleration of this standard deviation [rad/s²], independent in every step of
    `dt` [s], moves the joint; position and velocity are measured with noises [rad, rad/s], each at
    least `LEAST`.
    """
    A = np.array([[1.0, dt], [0.0, 1.0]])
    B = np.array([[0.5 * dt * dt], [dt]])
    R = np.diag([max(noise_q, LEAST[0]) ** 2, max(noise_v, LEAST[1]) ** 2])
    P = solve_discrete_are(A.T, np.eye(2), acceleration**2 * B @ B.T + 1e-18 * np.eye(2), R)
    gains = P @ np.linalg.inv(P + R)
    gains.setflags(write=False)  # they are shared
    return gains


def rate_gain(dt: float, acceleration: float, noise: float) -> float:
    """The gain of the stationary Kalman filter of a number that is measured with `noise`."""
    q, r = (acceleration * dt) ** 2, max(noise, 1e-6) ** 2
    prior = 0.5 * q + np.sqrt(0.25 * q * q + q * r)
    return float(prior / (prior + r))


@compiled
def follow_measurements(o: Odometry, last: int, earlier: int):
    """Take in all measurements up to the number `last`; see `keep_joints`, `keep_velocity`.

    `earlier`: physics steps by which what acts was asked for before.
    """
    n = o.rings.q.shape[0]
    for number in range(max(o.seen, last - n + 1), last):
        row = (o.rings.next - o.rings.count + number + n) % n
        keep_joints(o, row, number - 1 - earlier)
        keep_velocity(o, row)
    o.seen = max(last, o.seen)


@compiled
def keep_joints(o: Odometry, row: int, asked: int):
    """Joint positions, velocities and the root's angular one: promised ones, then corrected."""
    r, p, dt = o.rings, o.promises, o.robot.timestep
    n = p.rows.shape[0]
    promised = asked >= 0 and asked < p.written
    for a in range(3):
        if promised:
            o.v[3 + a] += dt * p.rows[asked % n, 3 + a]
        o.v[3 + a] += o.rate_gain * (r.gyro[row, a] - o.v[3 + a])
    for j in range(o.q.shape[0]):
        accel = p.rows[asked % n, 6 + j] if promised else 0.0
        o.q[j] += dt * (o.v[6 + j] + 0.5 * dt * accel)
        o.v[6 + j] += dt * accel
        error_q, error_v = r.q[row, j] - o.q[j], r.dq[row, j] - o.v[6 + j]
        o.q[j] += o.gains[0, 0] * error_q + o.gains[0, 1] * error_v
        o.v[6 + j] += o.gains[1, 0] * error_q + o.gains[1, 1] * error_v


@compiled
def keep_velocity(o: Odometry, row: int):
    """The root's velocity and the accelerometer's bias b, by a Kalman filter of each component.

    The accelerometer leads on, v ← v + (R f + g + b) dt, and the legs correct, see `correct`.
    """
    r, dt = o.rings, o.robot.timestep
    copy_axes(r.attitude[row], o.axes)
    for a in range(3):
        accel = o.bias[a] - (o.robot.gravity if a == 2 else 0.0)
        for b in range(3):
            accel += o.axes[a, b] * r.force[row, b]
        o.v[a] += dt * accel
        o.position[a] += dt * o.v[a]
    vv, vb, bb = o.var_v, o.cov_vb, o.var_b
    o.var_v = vv + dt * (2.0 * vb + dt * bb) + (o.acceleration_noise * dt) ** 2
    o.cov_vb = vb + dt * bb
    o.var_b = bb + dt * o.bias_walk**2
    place_pressure(o, row)
    for i in range(o.state.contacts.shape[0]):
        if r.found[row, i] > 0.0 and o.share[i] > 0.0:
            correct(o, row, i)


@compiled
def place_pressure(o: Odometry, row: int):
    """Where each sole is pressed, relative to its middle, and its part of the load.

    The centre of pressure of the whole ground's wrench, moved into a sole, is the point at which
    that sole rests though it rolls on an edge. Two soles share the load as it lies between them.
    """
    r, s, w = o.rings, o.state, o.rings.wrench[row]
    nc = s.contacts.shape[0]
    fx, fy, fz, mx, my = 0.0, 0.0, 0.0, 0.0, 0.0
    for b in range(3):
        fx, fy, fz = fx + o.axes[0, b] * w[b], fy + o.axes[1, b] * w[b], fz + o.axes[2, b] * w[b]
        mx, my = mx + o.axes[0, b] * w[3 + b], my + o.axes[1, b] * w[3 + b]
    borne = fz > 0.1 * o.robot.mass * o.robot.gravity
    first, second = s.sole_point[0], s.sole_point[nc - 1]
    height = s.qpos[2] - 0.5 * (first[2] + second[2])
    x = s.qpos[0] - (my + height * fx) / fz if borne else 0.5 * (first[0] + second[0])
    y = s.qpos[1] + (mx - height * fy) / fz if borne else 0.5 * (first[1] + second[1])
    dx, dy = second[0] - first[0], second[1] - first[1]
    between = ((x - first[0]) * dx + (y - first[1]) * dy) / max(dx * dx + dy * dy, 1e-6)
    between = min(max(between, 0.0), 1.0)
    for i in range(nc):
        alone = nc != 2 or r.found[row, 1 - i] <= 0.0
        load = 1.0 if alone else (between if i == 1 else 1.0 - between)
        o.share[i] = load if borne else 0.0
        axes, px, py = s.sole_axes[i], x - s.sole_point[i, 0], y - s.sole_point[i, 1]
        for a in range(2):
            along = axes[0, a] * px + axes[1, a] * py
            low, high = np.inf, -np.inf
            for k in range(o.robot.sole_vertices[i]):
                low = min(low, o.robot.sole_polygon[i, k, a])
                high = max(high, o.robot.sole_polygon[i, k, a])
            o.pressed[i, a] = min(max(along, low), high)


@compiled
def correct(o: Odometry, row: int, i: int):
    """Correct the velocity by sole i, whose pressed point rests: v = −(J_ω ω + J_q q̇) − ω_i × r.

    [1 J_ω J_q] is the Jacobian of the sole's middle, ω_i its angular velocity and r the pressed
    point from there. The gain falls with the noise of the joints' velocities and with the sole's
    angular velocity, and rises with the sole's share of the load.
    """
    s, dq, sole_v, axes = o.state, o.rings.dq[row], o.sole_v, o.state.sole_axes[i]
    for a in range(6):
        total = 0.0
        for b in range(3):
            total += s.J[6 * i + a, 3 + b] * o.rings.gyro[row, b]
        for j in range(dq.shape[0]):
            total += s.J[6 * i + a, 6 + j] * dq[j]
        sole_v[a] = total
    rx = axes[0, 0] * o.pressed[i, 0] + axes[0, 1] * o.pressed[i, 1]
    ry = axes[1, 0] * o.pressed[i, 0] + axes[1, 1] * o.pressed[i, 1]
    rz = axes[2, 0] * o.pressed[i, 0] + axes[2, 1] * o.pressed[i, 1]
    turning = 0.0  # of the filtered velocities: noise of the joints is no rolling
    for a in range(3, 6):
        rate = 0.0
        for j in range(3, o.v.shape[0]):
            rate += s.J[6 * i + a, j] * o.v[j]
        turning += rate * rate
    sole_v[0] += sole_v[4] * rz - sole_v[5] * ry
    sole_v[1] += sole_v[5] * rx - sole_v[3] * rz
    sole_v[2] += sole_v[3] * ry - sole_v[4] * rx
    reach = 0.0
    for a in range(3):
        for j in range(dq.shape[0]):
            reach += s.J[6 * i + a, 6 + j] ** 2 / 3.0
    doubt = o.slip**2 + o.roll_radius**2 * turning
    doubt += o.rate_noise**2 * reach
    doubt /= o.share[i] ** 2
    vv, vb = o.var_v, o.cov_vb
    gain, gain_bias = vv / (vv + doubt), vb / (vv + doubt)
    o.var_b -= gain_bias * vb
    o.var_v = vv * (1.0 - gain)
    o.cov_vb = vb * (1.0 - gain)
    for a in range(3):
        error = -sole_v[a] - o.v[a]
        o.v[a] += gain * error
        o.bias[a] += gain_bias * error


@compiled
def copy_axes(source: np.ndarray, out: np.ndarray):
    """`out[:] = source` of two frames (3, 3)."""
    for a in range(3):
        copy_into(source[a], out[a])
