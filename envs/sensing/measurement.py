"""Sensors: what is measured of a robot after each physics step, with their errors.

An IMU on the root gives attitude, angular velocity and specific force; encoders give joint
positions and velocities; the soles give the ground's wrench and which of them touches it. All of it
is in the root's frame or without one: no sensor tells where the root is, nor how fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.noise import add_noise, normal
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.motor_bus import MotorBus

from .drawn import DrawnRobot

RING = 64  # physics steps that are remembered
DRIFT_TIME = 1.0  # [s] correlation time of the attitude's drift


@dataclass(eq=False)
class Rings(Block):
    """The measurements of the last `RING` physics steps; nj joints, nc soles.

    `truth_qpos`, `truth_qvel` are what no sensor gives: only the estimator `exact` reads them.
    """

    next: Mutable[int]  # the row of the next measurement
    count: Mutable[int]  # measurements since the reset
    attitude: Annotated[np.ndarray, RING, 3, 3]  # axes of the IMU in a frame whose z is up
    gyro: Annotated[np.ndarray, RING, 3]  # angular velocity, root axes [rad/s]
    force: Annotated[np.ndarray, RING, 3]  # specific force Rᵀ(a − g), root axes [m/s²]
    q: Annotated[np.ndarray, RING, "nj"]  # [rad]
    dq: Annotated[np.ndarray, RING, "nj"]  # [rad/s]
    wrench: Annotated[np.ndarray, RING, 6]  # of the ground, about the root: force, moment; its axes
    found: Annotated[np.ndarray, RING, "nc+1"]  # ground contacts: of each foot, of anything
    truth_qpos: Annotated[np.ndarray, RING, "nq"]
    truth_qvel: Annotated[np.ndarray, RING, "nv"]


@dataclass(eq=False)
class Sensors(Block):
    """The sensors of an episode's robot, and what they measure."""

    robot: RobotArrays
    views: SimViews
    rings: Rings
    seed: Annotated[np.ndarray, 1, np.uint64]  # see `uniform`
    encoder: Mutable[float]  # deviations of what is measured: of joint positions [rad]
    velocity: Mutable[float]  # of joint velocities [rad/s]
    gyro: Mutable[float]  # [rad/s]
    accelerometer: Mutable[float]  # [m/s²]
    tilt: Mutable[float]  # of the drift of the attitude [rad]
    force: Mutable[float]  # of the ground's force [weight]
    cop: Mutable[float]  # [m]
    backlash: Mutable[float]  # play of the joints [rad]
    encoder_bias: Annotated[np.ndarray, "nj"]
    gyro_bias: Annotated[np.ndarray, 3]
    force_bias: Annotated[np.ndarray, 3]  # of the accelerometer
    mount: Annotated[np.ndarray, 3, 3]  # axes of the IMU in the root's frame
    level: Annotated[np.ndarray, 3, 3]  # from the simulation's axes to those whose z is up
    gravity: Annotated[np.ndarray, 3]  # in the simulation's axes [m/s²]
    drift: Annotated[np.ndarray, 3]  # rotation vector of the attitude's error now [rad]
    play: Annotated[np.ndarray, "nj"]  # motor's position over the joint's, within backlash [rad]
    last_q: Annotated[np.ndarray, "nj"]  # joint positions at the last measurement
    last_velocity: Annotated[np.ndarray, 3]  # of the root, at the last measurement
    bus: MotorBus  # has what the encoders read now: motors have it at once


@compiled
def arrived(r: Rings, late: int) -> int:
    """The row of the newest measurement that is known, `late` physics steps after it was taken."""
    n = r.q.shape[0]
    return (r.next - 1 - min(late, n - 1) + n) % n


def begin_sensors(s: Sensors, drawn: DrawnRobot, model: mujoco.MjModel) -> None:
    """Start an episode; all that would have been measured before it is its start."""
    d = drawn.noise
    s.encoder, s.velocity, s.gyro = d["encoder_noise"], d["velocity_noise"], d["gyro_noise"]
    s.accelerometer, s.tilt = d["accelerometer_noise"], d["tilt_drift"]
    s.force, s.cop, s.backlash = d["force_noise"], d["cop_noise"], drawn.backlash
    s.seed[0] = drawn.seed
    s.encoder_bias[:], s.gyro_bias[:] = drawn.encoder_bias, drawn.gyro_bias
    s.force_bias[:] = drawn.accelerometer_bias
    s.mount[:] = rotation(drawn.tilt_bias)
    s.gravity[:] = model.opt.gravity
    s.level[:] = levelling(model.opt.gravity)
    s.drift[:] = 0.0
    s.play[:] = 0.0
    s.last_q[:], s.last_velocity[:] = s.views.qpos[7:], s.views.qvel[:3]
    add_noise(s.seed, s.tilt, s.drift)
    s.rings.next = 0
    for _ in range(RING):
        measure(s)
    s.rings.count = 1


def rotation(vector: np.ndarray) -> np.ndarray:
    """(3, 3) exp(skew(φ)) of a rotation vector φ (3,) [rad]."""
    quaternion, axes = np.zeros(4), np.zeros(9)
    angle = float(np.linalg.norm(vector))
    mujoco.mju_axisAngle2Quat(quaternion, vector / angle if angle > 0.0 else vector, angle)
    mujoco.mju_quat2Mat(axes, quaternion)
    return axes.reshape(3, 3)


def levelling(gravity: np.ndarray) -> np.ndarray:
    """(3, 3) the least rotation that turns the direction against `gravity` (3,) into z."""
    up = -gravity / np.linalg.norm(gravity)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    if sine == 0.0:
        return np.eye(3)
    return rotation(axis / sine * np.arctan2(sine, up[2]))


@compiled
def measure(s: Sensors):
    """Write what the sensors read now over the oldest measurement."""
    r, k = s.rings, s.rings.next
    r.next = (k + 1) % r.q.shape[0]
    r.count += 1
    _measure_root(s, k)
    _measure_joints(s, k)
    _measure_soles(s, k)
    copy_into(s.views.qpos, r.truth_qpos[k])
    copy_into(s.views.qvel, r.truth_qvel[k])


@compiled
def _measure_root(s: Sensors, k: int):
    """Attitude (1 + skew(drift)) level R mount, gyro mountᵀ ω, specific force mountᵀ Rᵀ(a − g).

    a is the difference of the root's velocities over the physics step.
    """
    r, v, dt = s.rings, s.views, s.robot.timestep
    xmat = v.xmat[s.robot.root_body]
    remain = np.exp(-dt / DRIFT_TIME)
    stir = s.tilt * np.sqrt(1.0 - remain * remain)
    for a in range(3):
        s.drift[a] *= remain
    add_noise(s.seed, stir, s.drift)
    for a in range(3):
        for b in range(3):
            total = 0.0
            for c in range(3):
                for d in range(3):
                    total += s.level[a, c] * xmat[3 * c + d] * s.mount[d, b]
            r.attitude[k, a, b] = total
    for b in range(3):
        x, y, z = r.attitude[k, 0, b], r.attitude[k, 1, b], r.attitude[k, 2, b]
        r.attitude[k, 0, b] = x + s.drift[1] * z - s.drift[2] * y
        r.attitude[k, 1, b] = y + s.drift[2] * x - s.drift[0] * z
        r.attitude[k, 2, b] = z + s.drift[0] * y - s.drift[1] * x
    for b in range(3):
        rate, force = s.gyro_bias[b], s.force_bias[b]
        for d in range(3):
            rate += s.mount[d, b] * v.qvel[3 + d]
            for c in range(3):
                accel = (v.qvel[c] - s.last_velocity[c]) / dt - s.gravity[c]
                force += s.mount[d, b] * xmat[3 * c + d] * accel
        r.gyro[k, b], r.force[k, b] = rate, force
    add_noise(s.seed, s.gyro, r.gyro[k])
    add_noise(s.seed, s.accelerometer, r.force[k])
    copy_into(v.qvel[:3], s.last_velocity)


@compiled
def _measure_joints(s: Sensors, k: int):
    """Positions at the motor's side of the play, and velocities; the motors have them at once."""
    v, q, dq = s.views, s.bus.q, s.bus.dq
    half = 0.5 * s.backlash
    for j in range(q.shape[0]):
        now = v.qpos[7 + j]
        s.play[j] = min(max(s.play[j] - (now - s.last_q[j]), -half), half)
        s.last_q[j] = now
        q[j] = now + s.play[j] + s.encoder_bias[j]
        dq[j] = v.qvel[6 + j]
    add_noise(s.seed, s.encoder, q)
    add_noise(s.seed, s.velocity, dq)
    copy_into(q, s.rings.q[k])
    copy_into(dq, s.rings.dq[k])


@compiled
def _measure_soles(s: Sensors, k: int):
    """The ground's wrench on the root's axes, and contacts, as of the last step."""
    v, w, f = s.views, s.rings.wrench[k], s.views.qfrc_constraint
    xmat = v.xmat[s.robot.root_body]
    weight = s.robot.mass * s.robot.gravity
    for a in range(3):
        w[a], w[3 + a] = 0.0, f[3 + a]
        for b in range(3):
            w[a] += xmat[3 * b + a] * f[b]
    if f[2] > 0.0:
        add_noise(s.seed, s.force * weight, w[:3])
        deviation = s.cop * f[2]
        if deviation > 0.0:
            w[3] += deviation * normal(s.seed)
            w[4] += deviation * normal(s.seed)
    for i in range(s.robot.sole_sensor.shape[0]):
        s.rings.found[k, i] = v.sensordata[s.robot.sole_sensor[i]]
    s.rings.found[k, s.robot.sole_sensor.shape[0]] = v.sensordata[s.robot.ground_sensor]
