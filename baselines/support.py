"""What the soles press with for a wanted wrench on the body, and points of the support polygon."""

import numpy as np

from poise.envs.jit import compiled
from poise.envs.state import RobotState
from poise.envs.vectors import skew

#: Lever [m per m of CoM height] that makes a sole's moment as dear as a force.
MOMENT_LEVER = 0.05


def sole_wrenches(state: RobotState, wrench: np.ndarray) -> np.ndarray:
    """(6 nc,) the smallest sole wrenches w whose sum is `wrench` (6,) about the CoM.

    Minimises Σ |f_i|² + |n_i|²/ℓ² subject to [Σ f_i; Σ (r_i − c) × f_i + n_i] = wrench; no cone.
    """
    soles = len(state.sole_points)
    G = np.zeros((6, 6 * soles))
    lever = MOMENT_LEVER * state.robot.height_com
    for i, point in enumerate(state.sole_points):
        G[:3, 6 * i : 6 * i + 3] = np.eye(3)
        G[3:, 6 * i : 6 * i + 3] = skew(point - state.com)
        G[3:, 6 * i + 3 : 6 * i + 6] = np.eye(3)
    price = np.tile(np.concatenate([np.ones(3), np.full(3, lever**2)]), soles)
    GW = G * price
    return GW.T @ np.linalg.solve(GW @ G.T, wrench)


def joint_torques(state: RobotState, wrenches: np.ndarray) -> np.ndarray:
    """(nv−6,) torques that hold all joints while the soles press with `wrenches`: h − Jᵀ w."""
    return (state.h - state.J.T @ wrenches)[6:]


@compiled
def find_nearest(polygon: np.ndarray, point: np.ndarray, out: np.ndarray):
    """The point of a convex counter-clockwise `polygon` (k, 2) nearest to `point` into `out`."""
    x, y = point[0], point[1]
    out[0], out[1] = x, y
    n, least, outside = polygon.shape[0], np.inf, False
    for i in range(n):
        ax, ay = polygon[i, 0], polygon[i, 1]
        ex, ey = polygon[(i + 1) % n, 0] - ax, polygon[(i + 1) % n, 1] - ay
        outside = outside or ex * (y - ay) - ey * (x - ax) < 0.0
        along = ((x - ax) * ex + (y - ay) * ey) / max(ex * ex + ey * ey, 1e-18)
        share = min(max(along, 0.0), 1.0)
        px, py = ax + share * ex, ay + share * ey
        distance = (px - x) ** 2 + (py - y) ** 2
        if distance < least:
            least = distance
            out[0], out[1] = px, py
    if not outside:
        out[0], out[1] = x, y


def nearest_inside(polygon: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The point of a convex counter-clockwise `polygon` (k, 2) that is nearest to `point` (2,)."""
    out = np.empty(2)
    find_nearest(np.array(polygon), np.array(point, dtype=float), out)
    return out


def shrunk(polygon: np.ndarray, share: float) -> np.ndarray:
    """`polygon` (k, 2) scaled about the mean of its vertices."""
    middle = polygon.mean(axis=0)
    return middle + share * (polygon - middle)
