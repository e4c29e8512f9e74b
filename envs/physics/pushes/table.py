"""The table of pushes that compiled code reads, and what it writes of them in a physics step."""

from collections.abc import Sequence

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .push import Kick, Push, unit_vector

NOTHING, PUSH, KICK = 0, 1, 2  # kinds; a row of zeros is no push
SQUARE, HALF_SINE = 0, 1  # profiles
ROW = np.dtype(
    [
        ("kind", np.int64),
        ("body", np.int64),
        ("start", float),  # [s]
        ("duration", float),  # [s]
        ("force", float, 3),  # peak, world axes [N]; of a kick the change of velocity [m/s]
        ("point", float, 3),  # in the body's frame [m]
        ("profile", np.int64),
    ],
    align=True,
)


def pack(pushes: Sequence[Push | Kick], robot: Robot, heading_yaw: float) -> np.ndarray:
    """Table (k,) of `ROW` for the compiled kernels, one row per push.

    `heading_yaw` [rad] is the yaw of the heading frame at the reset.
    """
    table = np.zeros(len(pushes), ROW)
    cos, sin = np.cos(heading_yaw), np.sin(heading_yaw)
    to_world = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for row, push in zip(table, pushes, strict=True):
        row["start"] = push.start
        if isinstance(push, Kick):
            row["body"], row["kind"] = robot.root_body_id, KICK
            row["force"] = push.delta_v * to_world @ unit_vector(push.direction)
        else:
            row["body"], row["kind"] = robot.model.body(push.body).id, PUSH
            row["duration"] = push.duration
            direction = unit_vector(push.direction, push.elevation)
            row["force"] = push.peak_force * to_world @ direction
            row["point"] = push.point
            row["profile"] = HALF_SINE if push.profile == "half-sine" else SQUARE
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
        if push.kind != PUSH:
            continue
        start, duration = push.start, push.duration
        begin = max(t, start) - start
        end = min(t + dt, start + duration) - start
        if end <= begin:
            continue
        if push.profile == SQUARE:
            fraction = (end - begin) / dt
        else:
            rate = np.pi / duration
            fraction = (np.cos(rate * begin) - np.cos(rate * end)) / (rate * dt)
        force, point = push.force, push.point
        fx, fy, fz = fraction * force[0], fraction * force[1], fraction * force[2]
        px, py, pz = point[0], point[1], point[2]
        R = xmat[push.body]
        rx = R[0] * px + R[1] * py + R[2] * pz
        ry = R[3] * px + R[4] * py + R[5] * pz
        rz = R[6] * px + R[7] * py + R[8] * pz
        wrench = xfrc_applied[push.body]
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
        kick = table[k]
        if kick.kind == KICK and np.floor(kick.start / dt + 1e-6) == step:
            change = kick.force
            for a in range(3):
                qvel[a] += change[a]
