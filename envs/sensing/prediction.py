"""Prediction of the state at which the torques of this tick act.

Measurements and commands are delayed. In between the robot follows torques that are known already,
and the QP has predicted the accelerations that they cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import axes_of, copy_into, quaternion_of
from poise.envs.compiled.mujoco_calls import mj_step1, mj_step2
from poise.envs.physics.arrays import RobotArrays, SimViews

from .motors import DAMPING, STIFFNESS, TARGET, TORQUE, Motors


@dataclass(frozen=True, eq=False)
class Promises(Block):
    """Accelerations that the controller has promised, one row for each physics step."""

    last: Annotated[np.ndarray, "nv"]  # of the running tick; zero if there are none
    rows: Annotated[np.ndarray, "n", "nv"]  # by the number of the physics step that asked for them
    written: Annotated[np.ndarray, 1, np.int64]  # physics steps whose rows are written


@compiled
def keep_promises(p: Promises, now: int):
    """Write the last promise for all physics steps before `now` that have none yet."""
    n, nv = p.rows.shape
    for step in range(max(p.written[0], now - n), now):
        for j in range(nv):
            p.rows[step % n, j] = p.last[j]
    p.written[0] = max(now, p.written[0])


@compiled
def turn_axes(R: np.ndarray, x: float, y: float, z: float):
    """R ← R exp(skew(φ)) of axes R (3, 3) and a turn φ = (x, y, z) about their own axes [rad]."""
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle > 1e-6:
        s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    else:
        s, c = 1.0 - square / 6.0, 0.5 - square / 24.0
    for a in range(3):
        u, v, w = R[a, 0], R[a, 1], R[a, 2]
        # r exp(skew φ) of a row r is r + s (r × φ) + c (r × φ) × φ
        p, q, t = v * z - w * y, w * x - u * z, u * y - v * x
        R[a, 0] = u + s * p + c * (q * z - t * y)
        R[a, 1] = v + s * q + c * (t * x - p * z)
        R[a, 2] = w + s * t + c * (p * y - q * x)


@compiled
def predict(
    p: Promises, first: int, count: int, earlier: int, dt: float,
    position: np.ndarray, R: np.ndarray, q: np.ndarray, v: np.ndarray,
):  # fmt: skip
    """Lead a state on from the physics step `first` by `count` steps of `dt` [s], in place.

    In step x the robot follows the command of step x − `earlier`:

        v ← v + v̇ dt,   position ← position + v dt,   R ← R exp(skew(ω dt)),   q ← q + q̇ dt

    Args:
        position: (3,) of the root; R: (3, 3) its axes; q: (nj,) joints.
        v: (nv,) linear velocity in world axes, angular in root axes, joint velocities.
    """
    n, nv = p.rows.shape
    for x in range(first, first + count):
        asked = x - earlier
        if asked >= 0 and asked < p.written[0]:
            for j in range(nv):
                v[j] += dt * p.rows[asked % n, j]
        for a in range(3):
            position[a] += dt * v[a]
        turn_axes(R, dt * v[3], dt * v[4], dt * v[5])
        for j in range(q.shape[0]):
            q[j] += dt * v[6 + j]


@dataclass(frozen=True, eq=False)
class Rollout(Block):
    """A simulation of the known robot, of which nothing is remembered."""

    robot: RobotArrays
    views: SimViews
    motors: Motors  # their past commands


@compiled
def roll_out(
    o: Rollout, first: int, count: int, earlier: int, wrench: np.ndarray,
    position: np.ndarray, R: np.ndarray, q: np.ndarray, v: np.ndarray,
):  # fmt: skip
    """Lead a state on by `count` physics steps of the known robot, in place.

    In step x its motors follow the command of step x − `earlier`, as `drive_motors` does, by the
    joints of the simulation. All the while `wrench` (6,) acts on the root: a force, and
    a moment about the CoM of the robot at the start, world axes. Other arguments as of `predict`.
    """
    views, m, n = o.views, o.motors, o.motors.asked.shape[0]
    copy_into(position, views.qpos[:3])
    quaternion_of(R, views.qpos[3:7])
    copy_into(q, views.qpos[7:])
    copy_into(v, views.qvel)
    mj_step1(views.model_address, views.data_address)
    _push(o, wrench)
    written = m.written[0]
    for x in range(first, first + count):
        asked = m.asked[max(min(x - earlier, written - 1), 0) % n]
        for i in range(views.ctrl.shape[0]):
            dof = m.robot.motor_dofs[i]
            torque = asked[TORQUE, i]
            if asked[STIFFNESS, i] != 0.0 or asked[DAMPING, i] != 0.0:
                torque += asked[STIFFNESS, i] * (asked[TARGET, i] - views.qpos[dof + 1])
                torque -= asked[DAMPING, i] * views.qvel[dof]
            most = o.robot.torque_limit[i]
            views.ctrl[i] = min(max(torque, -most), most)
        mj_step2(views.model_address, views.data_address)
        mj_step1(views.model_address, views.data_address)
    copy_into(views.qpos[:3], position)
    axes_of(views.qpos[3:7], R)
    copy_into(views.qpos[7:], q)
    copy_into(views.qvel, v)


@compiled
def _push(o: Rollout, wrench: np.ndarray):
    """Let a wrench about the robot's CoM act on the root: MuJoCo takes it about the root's."""
    root = o.robot.root_body
    com, at, given = o.views.subtree_com[root], o.views.xipos[root], o.views.xfrc_applied[root]
    copy_into(wrench, given)
    x, y, z = com[0] - at[0], com[1] - at[1], com[2] - at[2]
    given[3] += y * wrench[2] - z * wrench[1]
    given[4] += z * wrench[0] - x * wrench[2]
    given[5] += x * wrench[1] - y * wrench[0]
