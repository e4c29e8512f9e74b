"""How postures move whose soles stay where the robot stands, and how they are led back there."""

from typing import NamedTuple

import mujoco
import numpy as np

from poise.baselines.motion.space_time.constraints.scene import Scene

RANK = 1e-6  # of the largest singular value: smaller ones are rounding
SINGULAR = 0.02  # as in the solver of single frames: what hardly moves a foot is damped
NEWTON, CLOSE = 6, 1e-10  # steps to planted soles at most, and the error [m, rad] that ends them


class SoleMotions(NamedTuple):
    """The displacements δ = δ₀ + N z of a frame that lead its planted soles to where they are to
    be, as far as first order goes.

    Attributes:
        given: (nv,) δ₀, the shortest of them.
        free: (nv, r) N, orthonormal.
    """

    given: np.ndarray
    free: np.ndarray


def motions(scene: Scene, frame: int) -> SoleMotions:
    """The displacements that keep both soles of a frame where they are planted.

    With the rows A = U S Vᵀ of both feet, N is the complement of V, and δ₀ = −V S/(S² + λ²) Uᵀ e:
    where legs hardly move a foot (ankles of one axis) an error asks for no large motion.
    """
    error, rows = sole_error(scene, frame)
    left, values, right = np.linalg.svd(rows)
    rank = int((values > RANK * values[0]).sum())
    gains = values[:rank] / (values[:rank] ** 2 + SINGULAR**2)
    given = -right[:rank].T @ (gains * (left.T[:rank] @ error))
    return SoleMotions(given, right[rank:].T)


def sole_error(scene: Scene, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors (12,) of the feet in a frame [m, rad], and their derivative (12, nv)."""
    data, errors = scene.at(frame), list[np.ndarray]()
    rows: list[np.ndarray] = []
    for sole, place, axes in zip(scene.robot.soles, *scene.standing_feet, strict=True):
        turn, back = np.empty(4), np.empty(4)
        mujoco.mju_negQuat(back, axes)
        mujoco.mju_mulQuat(turn, data.xquat[sole.body_id], back)
        tilt, jacobian = np.empty(3), np.empty((2, 3, scene.model.nv))
        mujoco.mju_quat2Vel(tilt, turn, 1.0)
        mujoco.mj_jacBody(scene.model, data, jacobian[0], jacobian[1], sole.body_id)
        errors += [data.xpos[sole.body_id] - place, tilt]
        rows += [jacobian[0], jacobian[1]]
    return np.concatenate(errors), np.concatenate(rows)


def move_soles(scene: Scene, frames: np.ndarray) -> None:
    """Lead the soles of some frames (k,) to their places, by the shortest displacements."""
    for frame in frames.tolist():
        for _ in range(NEWTON):
            given = motions(scene, frame).given
            if np.abs(given).max() < CLOSE:
                break
            scene.displace(frame, given)
