"""The state of a robot from an IMU, encoders and soles: legs and accelerometer tell its velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.maths.vectors import copy_into
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .measurement import Rings
from .prediction import Promises

FROM_Q, FROM_DQ = 0, 1  # columns of `Odometry.gains`
STIR, LEGS, ROLL, RATE_GAIN = range(4)  # entries of `Odometry.numbers`
MOST_VARIANCE = 1.0  # [m²/s²]


@dataclass(frozen=True, eq=False)
class Odometry(Block):
    """What is remembered of a robot (nj joints, nc soles), as of the last measurement."""

    robot: RobotArrays
    state: StateArrays  # the state believed in the tick before: its Jacobians serve here
    rings: Rings
    promises: Promises
    seen: np.ndarray  # (1,) int: measurements that have been used
    position: np.ndarray  # (3,) of the root [m]
    axes: np.ndarray  # (3, 3) of the root
    q: np.ndarray  # (nj,) [rad]
    v: np.ndarray  # (nv,) velocity: of the root in world axes, its angular one, the joints'
    variance: np.ndarray  # (1,) of each component of the root's velocity [m²/s²]
    gains: np.ndarray  # (2, 2) rows q, q̇: corrections by errors of q and q̇
    numbers: np.ndarray  # (4,) see STIR and its like


def allocate_odometry(
    robot: RobotArrays, state: StateArrays, rings: Rings, promises: Promises
) -> Odometry:
    """An estimator that has seen nothing."""
    zeros, nv = guarded_zeros, len(state.qvel)
    return Odometry(
        robot, state, rings, promises, zeros(1, np.int64), zeros(3), zeros((3, 3)), zeros(nv - 6),
        zeros(nv), zeros(1), zeros((2, 2)), zeros(4),
    )  # fmt: skip


def filter_gains(dt: float, acceleration: float, noise_q: float, noise_v: float) -> np.ndarray:
    """(2, 2) gains of the stationary Kalman filter of a joint, whose state is (q, q̇).

    An acceleration that nobody knows, of this standard deviation [rad/s²] and new in every step of
    `dt` [s], moves the joint; position and velocity are measured with noises [rad, rad/s].
    """
    A = np.array([[1.0, dt], [0.0, 1.0]])
    B = np.array([[0.5 * dt * dt], [dt]])
    R = np.diag([max(noise_q, 1e-6) ** 2, max(noise_v, 1e-6) ** 2])
    P = solve_discrete_are(A.T, np.eye(2), acceleration**2 * B @ B.T + 1e-18 * np.eye(2), R)
    return P @ np.linalg.inv(P + R)


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
    for number in range(max(o.seen[0], last - n + 1), last):
        row = (o.rings.next[0] - o.rings.count[0] + number + n) % n
        keep_joints(o, row, number - 1 - earlier)
        keep_velocity(o, row)
    o.seen[0] = max(last, o.seen[0])


@compiled
def keep_joints(o: Odometry, row: int, asked: int):
    """Joint positions, velocities and the root's angular one: promised ones, then corrected."""
    r, p, dt = o.rings, o.promises, o.robot.timestep
    n = p.rows.shape[0]
    promised = asked >= 0 and asked < p.written[0]
    for a in range(3):
        if promised:
            o.v[3 + a] += dt * p.rows[asked % n, 3 + a]
        o.v[3 + a] += o.numbers[RATE_GAIN] * (r.gyro[row, a] - o.v[3 + a])
    for j in range(o.q.shape[0]):
        accel = p.rows[asked % n, 6 + j] if promised else 0.0
        o.q[j] += dt * (o.v[6 + j] + 0.5 * dt * accel)
        o.v[6 + j] += dt * accel
        error_q, error_v = r.q[row, j] - o.q[j], r.dq[row, j] - o.v[6 + j]
        o.q[j] += o.gains[0, FROM_Q] * error_q + o.gains[0, FROM_DQ] * error_v
        o.v[6 + j] += o.gains[1, FROM_Q] * error_q + o.gains[1, FROM_DQ] * error_v


@compiled
def keep_velocity(o: Odometry, row: int):
    """The root's velocity: ċ ← ċ + (R f + g) dt of the accelerometer, corrected by the legs.

    A sole that touches the ground rests, so it tells v = −J_ω ω − J_q q̇ of the rest of its Jacobian
    J = [1 J_ω J_q]. It is believed the less the faster the sole turns: then it rolls on an edge.
    """
    r, s, dt = o.rings, o.state, o.robot.timestep
    nv = o.v.shape[0]
    copy_axes(r.attitude[row], o.axes)
    for a in range(3):
        accel = -o.robot.gravity if a == 2 else 0.0
        for b in range(3):
            accel += o.axes[a, b] * r.force[row, b]
        o.v[a] += dt * accel
        o.position[a] += dt * o.v[a]
    o.variance[0] = min(o.variance[0] + (o.numbers[STIR] * dt) ** 2, MOST_VARIANCE)
    for i in range(s.contacts.shape[0]):
        if r.found[row, i] <= 0.0:
            continue
        turning = 0.0
        for a in range(3):
            rate = 0.0
            for b in range(3):
                rate += s.J[6 * i + 3 + a, 3 + b] * r.gyro[row, b]
            for j in range(6, nv):
                rate += s.J[6 * i + 3 + a, j] * r.dq[row, j - 6]
            turning += rate * rate
        doubt = o.numbers[LEGS] ** 2 + o.numbers[ROLL] ** 2 * turning
        gain = o.variance[0] / (o.variance[0] + doubt)
        o.variance[0] *= 1.0 - gain
        for a in range(3):
            told = 0.0
            for b in range(3):
                told -= s.J[6 * i + a, 3 + b] * r.gyro[row, b]
            for j in range(6, nv):
                told -= s.J[6 * i + a, j] * r.dq[row, j - 6]
            o.v[a] += gain * (told - o.v[a])


@compiled
def copy_axes(source: np.ndarray, out: np.ndarray):
    """`out[:] = source` of two frames (3, 3)."""
    for a in range(3):
        copy_into(source[a], out[a])
