"""The table of pushes that compiled code reads, and what it writes of them in a physics step."""

from collections.abc import Sequence

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .push import Kick, Push, unit_vector

TABLE_COLUMNS = 12


def pack(pushes: Sequence[Push | Kick], robot: Robot, heading_yaw: float) -> np.ndarray:
    """Table (k, 12) for the compiled kernels, one row per push.

    Columns: body id, start, duration, peak world force x y z [N] (of a kick: world Δv [m/s]),
    point x y z in the body frame [m], profile (0 square, 1 half-sine), kind (0 force, 1 kick),
    spare. `heading_yaw` [rad] is the yaw of the heading frame at the reset.
    """
    table = np.zeros((len(pushes), TABLE_COLUMNS))
    cos, sin = np.cos(heading_yaw), np.sin(heading_yaw)
    to_world = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for row, push in zip(table, pushes, strict=True):
        row[1] = push.start
        if isinstance(push, Kick):
            row[0] = robot.root_body_id
            row[3:6] = push.delta_v * to_world @ unit_vector(push.direction)
            row[10] = 1.0
        else:
            row[0] = robot.model.body(push.body).id
            row[2] = push.duration
            row[3:6] = push.peak_force * to_world @ unit_vector(push.direction, push.elevation)
            row[6:9] = push.point
            row[9] = float(push.profile == "half-sine")
    return table


@compiled
def apply_pushes(table, t, dt, xfrc_applied, xmat):
    """Add the forces active during the step [t, t + dt) to `xfrc_applied` (nbody, 6).

    The force written is the mean over the step, so Σ F dt = J for any start and duration.
    Rows are [force; torque] in the world frame at the body's centre of mass, with
    torque = (R point) × force; `xmat` (nbody, 9) holds R row by row. Clear `xfrc_applied` before.
    """
    for k in range(table.shape[0]):
        if table[k, 10] != 0.0:
            continue
        start, duration = table[k, 1], table[k, 2]
        begin = max(t, start) - start
        end = min(t + dt, start + duration) - start
        if end <= begin:
            continue
        if table[k, 9] == 0.0:
            share = (end - begin) / dt
        else:
            rate = np.pi / duration
            share = (np.cos(rate * begin) - np.cos(rate * end)) / (rate * dt)
        body = int(table[k, 0])
        fx, fy, fz = share * table[k, 3], share * table[k, 4], share * table[k, 5]
        px, py, pz = table[k, 6], table[k, 7], table[k, 8]
        R = xmat[body]
        rx = R[0] * px + R[1] * py + R[2] * pz
        ry = R[3] * px + R[4] * py + R[5] * pz
        rz = R[6] * px + R[7] * py + R[8] * pz
        wrench = xfrc_applied[body]
        wrench[0] += fx
        wrench[1] += fy
        wrench[2] += fz
        wrench[3] += ry * fz - rz * fy
        wrench[4] += rz * fx - rx * fz
        wrench[5] += rx * fy - ry * fx


@compiled
def apply_kicks(table, t, dt, qvel):
    """Add each kick whose start lies in the step [t, t + dt) to the root's velocity `qvel[:3]`.

    Call once per step; `qvel` (nv,) starts with the root's free joint (world frame). Steps are
    counted from t = 0, so that rounding at a step's end neither loses nor doubles a kick.
    """
    step = np.rint(t / dt)
    for k in range(table.shape[0]):
        if table[k, 10] == 1.0 and np.floor(table[k, 1] / dt + 1e-6) == step:
            qvel[0] += table[k, 3]
            qvel[1] += table[k, 4]
            qvel[2] += table[k, 5]
