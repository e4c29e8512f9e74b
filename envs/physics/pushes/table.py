"""The table of pushes that compiled code reads, and what it writes of them in a physics step."""

from collections.abc import Sequence

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .push import Kick, Push, unit_vector

# columns; of a force and a point three each
BODY, START, DURATION, FORCE, POINT, PROFILE, KIND = 0, 1, 2, 3, 6, 9, 10
TABLE_COLUMNS = 11
NOTHING, PUSH, KICK = 0.0, 1.0, 2.0  # kinds; a row of zeros is no push
SQUARE, HALF_SINE = 0.0, 1.0  # profiles


def pack(pushes: Sequence[Push | Kick], robot: Robot, heading_yaw: float) -> np.ndarray:
    """Table (k, 11) for the compiled kernels, one row per push.

    Columns: body id, start [s], duration [s], peak world force x y z [N] (of a kick: world Δv
    [m/s]), point x y z in the body frame [m], profile, kind. `heading_yaw` [rad] is the yaw of the
    heading frame at the reset.
    """
    table = np.zeros((len(pushes), TABLE_COLUMNS))
    cos, sin = np.cos(heading_yaw), np.sin(heading_yaw)
    to_world = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for row, push in zip(table, pushes, strict=True):
        row[START] = push.start
        if isinstance(push, Kick):
            row[BODY], row[KIND] = robot.root_body_id, KICK
            row[FORCE : FORCE + 3] = push.delta_v * to_world @ unit_vector(push.direction)
        else:
            row[BODY], row[KIND] = robot.model.body(push.body).id, PUSH
            row[DURATION] = push.duration
            direction = unit_vector(push.direction, push.elevation)
            row[FORCE : FORCE + 3] = push.peak_force * to_world @ direction
            row[POINT : POINT + 3] = push.point
            row[PROFILE] = HALF_SINE if push.profile == "half-sine" else SQUARE
    return table


@compiled
def apply_pushes(
    table: np.ndarray, t: float, dt: float, xfrc_applied: np.ndarray, xmat: np.ndarray
):
    """Add the forces active during the step [t, t + dt) to `xfrc_applied` (nbody, 6).

    The force written is the mean over the step, so Σ F dt = J for any start and duration.
    Rows are [force; torque] in the world frame at the body's centre of mass, with
    torque = (R point) × force; `xmat` (nbody, 9) holds R row by row. Clear `xfrc_applied` before.
    """
    for k in range(table.shape[0]):
        push = table[k]
        if push[KIND] != PUSH:
            continue
        start, duration = push[START], push[DURATION]
        begin = max(t, start) - start
        end = min(t + dt, start + duration) - start
        if end <= begin:
            continue
        if push[PROFILE] == SQUARE:
            fraction = (end - begin) / dt
        else:
            rate = np.pi / duration
            fraction = (np.cos(rate * begin) - np.cos(rate * end)) / (rate * dt)
        body = int(push[BODY])
        fx, fy, fz = fraction * push[FORCE], fraction * push[FORCE + 1], fraction * push[FORCE + 2]
        px, py, pz = push[POINT], push[POINT + 1], push[POINT + 2]
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
def apply_kicks(table: np.ndarray, t: float, dt: float, qvel: np.ndarray):
    """Add each kick whose start lies in the step [t, t + dt) to the root's velocity `qvel[:3]`.

    Call once per step; `qvel` (nv,) starts with the root's free joint (world frame). Steps are
    counted from t = 0, so that rounding at a step's end neither loses nor doubles a kick.
    """
    step = np.rint(t / dt)
    for k in range(table.shape[0]):
        if table[k, KIND] == KICK and np.floor(table[k, START] / dt + 1e-6) == step:
            for a in range(3):
                qvel[a] += table[k, FORCE + a]
