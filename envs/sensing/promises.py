"""Prediction of the state at which the torques of this tick act, by promised accelerations.

Measurements and commands are delayed. In between the robot follows torques that are known already,
and the QP has predicted the accelerations that they cause.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable


@dataclass(eq=False)
class Promises(Block):
    """Accelerations that the controller has promised, one row for each physics step."""

    last: Annotated[np.ndarray, "nv"]  # of the running tick; zero if there are none
    rows: Annotated[np.ndarray, "n", "nv"]  # by the number of the physics step that asked for them
    written: Mutable[int]  # physics steps whose rows are written


@compiled
def keep_promises(p: Promises, now: int):
    """Write the last promise for all physics steps before `now` that have none yet."""
    n, nv = p.rows.shape
    for step in range(max(p.written, now - n), now):
        for j in range(nv):
            p.rows[step % n, j] = p.last[j]
    p.written = max(now, p.written)


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
        if asked >= 0 and asked < p.written:
            for j in range(nv):
                v[j] += dt * p.rows[asked % n, j]
        for a in range(3):
            position[a] += dt * v[a]
        turn_axes(R, dt * v[3], dt * v[4], dt * v[5])
        for j in range(q.shape[0]):
            q[j] += dt * v[6 + j]
