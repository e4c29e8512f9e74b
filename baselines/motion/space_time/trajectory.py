"""Coordinates of a clip's postures and their third derivative."""

import numpy as np
from scipy import sparse

from poise.baselines.motion.clips.rotations import to_scipy

THIRD = (-1.0, 3.0, -3.0, 1.0)
SMALL = 1e-6  # [rad] below which the series is used


def coordinates(qpos: np.ndarray, standing: np.ndarray) -> np.ndarray:
    """(F, nv) of postures (F, nq): place of the root, φ, joints.

    φ is the rotation vector of the root relative to standing, R = R_standing exp(φ), and goes on
    without jumps of 2π from frame to frame.
    """
    rest, turns = to_scipy(standing[None, 3:7]), to_scipy(qpos[:, 3:7])
    return np.concatenate([qpos[:, :3], (rest.inv() * turns).as_rotvec(), qpos[:, 7:]], axis=1)


def rotation_derivative(phi: np.ndarray) -> np.ndarray:
    """(F, 3, 3) J_r⁻¹(φ): exp(φ) exp(δ) = exp(φ + J_r⁻¹ δ + O(δ²)), for φ (F, 3) [rad].

    J_r⁻¹ = I + ½ [φ]ₓ + (1/θ² − (1 + cos θ)/(2 θ sin θ)) [φ]ₓ², θ = ‖φ‖ < π.
    """
    theta = np.linalg.norm(phi, axis=1)
    safe = np.where(theta > SMALL, theta, 1.0)
    far = 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe))
    factor = np.where(theta > SMALL, far, 1.0 / 12.0)
    cross = np.zeros((len(phi), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[:, i, j], cross[:, j, i] = -phi[:, k], phi[:, k]
    return np.eye(3) + 0.5 * cross + factor[:, None, None] * (cross @ cross)


def coordinate_derivative(qpos: np.ndarray, standing: np.ndarray) -> sparse.csr_matrix:
    """(F nv, F nv) ∂x/∂δ, δ the displacements of `Scene.displace`; blocks on the diagonal."""
    phi, count = coordinates(qpos, standing)[:, 3:6], qpos.shape[1] - 1
    blocks = np.tile(np.eye(count), (len(qpos), 1, 1))
    blocks[:, 3:6, 3:6] = rotation_derivative(phi)
    return sparse.block_diag(list(blocks), format="csr")


def third_difference(frames: int, dt: float) -> sparse.csr_matrix:
    """(F + 3, F) third derivative of values at F frames that rest before and after [1/s³].

    The first and the last frame count for all before and after: a jump from and to rest costs.
    """
    rows = frames + 3
    columns = np.clip(np.arange(rows)[:, None] + np.arange(4) - 3, 0, frames - 1)
    values = np.tile(np.array(THIRD) / dt**3, rows)
    entries = (values, (np.repeat(np.arange(rows), 4), columns.ravel()))
    return sparse.coo_matrix(entries, shape=(rows, frames)).tocsr()


def jerk(qpos: np.ndarray, dt: float) -> float:
    """Root mean square of the joints' third derivative [rad/s³], by differences."""
    return float(np.sqrt(np.mean((np.diff(qpos[:, 7:], 3, axis=0) / dt**3) ** 2)))
