"""The least sole wrenches for a desired wrench on the body."""

import numpy as np

from poise.envs.compiled.maths.vectors import skew
from poise.envs.physics.state import RobotState

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
