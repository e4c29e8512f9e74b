"""The Jacobian of a point of a body, from MuJoCo's axes of the degrees of freedom."""

import numpy as np

from poise.envs.compiled.jit import compiled


@compiled
def point_jacobian(
    axes: np.ndarray,
    axes_dot: np.ndarray,
    qvel: np.ndarray,
    chain: np.ndarray,
    count: int,
    rx: float,
    ry: float,
    rz: float,
    J: np.ndarray,
    J_v: np.ndarray,
    Jdot_v: np.ndarray,
):
    """J (6, nv), J v (6,) and J̇ v (6,) of a point: its linear velocity, then the angular one.

    MuJoCo keeps the axes of the degrees of freedom and their derivatives, `axes` and `axes_dot`
    (nv, 6), at the subtree CoM o, angular part first. A point at o + (rx, ry, rz) moves with
    ṙ = lin + ang × r, and its acceleration has the additional ω × ṙ. The first `count` entries of
    `chain` are the degrees of freedom that move the body; columns of others are not written.
    """
    for a in range(6):
        J_v[a] = 0.0
        Jdot_v[a] = 0.0
    for k in range(count):
        d = chain[k]
        speed = qvel[d]
        wx, wy, wz = axes[d, 0], axes[d, 1], axes[d, 2]
        J[0, d] = axes[d, 3] + wy * rz - wz * ry
        J[1, d] = axes[d, 4] + wz * rx - wx * rz
        J[2, d] = axes[d, 5] + wx * ry - wy * rx
        J[3, d], J[4, d], J[5, d] = wx, wy, wz
        for a in range(6):
            J_v[a] += J[a, d] * speed
        wx, wy, wz = axes_dot[d, 0], axes_dot[d, 1], axes_dot[d, 2]
        Jdot_v[0] += speed * (axes_dot[d, 3] + wy * rz - wz * ry)
        Jdot_v[1] += speed * (axes_dot[d, 4] + wz * rx - wx * rz)
        Jdot_v[2] += speed * (axes_dot[d, 5] + wx * ry - wy * rx)
        Jdot_v[3] += speed * wx
        Jdot_v[4] += speed * wy
        Jdot_v[5] += speed * wz
    vx, vy, vz = J_v[0], J_v[1], J_v[2]
    wx, wy, wz = J_v[3], J_v[4], J_v[5]
    Jdot_v[0] += wy * vz - wz * vy
    Jdot_v[1] += wz * vx - wx * vz
    Jdot_v[2] += wx * vy - wy * vx
