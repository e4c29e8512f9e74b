"""What the soles press with for a wanted wrench on the body, and points of the support polygon."""

import numpy as np

from poise.envs.state import RobotState

#: Lever [m per m of CoM height] that makes a sole's moment as dear as a force.
MOMENT_LEVER = 0.05


def skew(r: np.ndarray) -> np.ndarray:
    """(3, 3) matrix of the cross product: skew(r) f = r × f."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


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


def nearest_inside(polygon: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The point of a convex counter-clockwise `polygon` (k, 2) that is nearest to `point` (2,)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    outside = edges[:, 0] * (point - polygon)[:, 1] - edges[:, 1] * (point - polygon)[:, 0] < 0.0
    if not outside.any():
        return point.copy()
    length = np.maximum(np.einsum("ij,ij->i", edges, edges), 1e-18)
    share = np.clip(np.einsum("ij,ij->i", point - polygon, edges) / length, 0.0, 1.0)
    candidates = polygon + share[:, None] * edges
    return candidates[np.argmin(np.sum((candidates - point) ** 2, axis=1))]


def shrunk(polygon: np.ndarray, share: float) -> np.ndarray:
    """`polygon` (k, 2) scaled about the mean of its vertices."""
    middle = polygon.mean(axis=0)
    return middle + share * (polygon - middle)
