"""The wrench of the ground on a robot whose feet measure no force."""

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

TOUCHES = 0.05  # [m g] on a sole that touches the ground
RANK = 1e-3  # of the largest singular value: a straight leg tells nothing along itself


class LegForces:
    """The wrench on the root from the torques of the legs.

    A leg that accelerates little has τ = h − Jᵀ w: its joints' torques, the bias forces h of
    gravity and velocity, and the wrench w of the ground on its sole.
    """

    def __init__(self, robot: Robot):
        self._robot, self._data = robot, mujoco.MjData(robot.model)
        self._jacobians = [np.zeros((6, robot.model.nv)) for _ in robot.soles]

    def __call__(
        self, attitude: np.ndarray, gyro: np.ndarray, q: np.ndarray, dq: np.ndarray,
        torque: np.ndarray,
    ) -> tuple[np.ndarray, list[bool]]:  # fmt: skip
        """The wrench (6,) about the root's origin, in its axes [N, N·m], and which soles touch.

        Args:
            attitude: (4,) of the root, w first; gyro: (3,) its own axes [rad/s].
            q, dq, torque: (nj,) of the joints.
        """
        robot, data, model = self._robot, self._data, self._robot.model
        data.qpos[:3], data.qpos[3:7], data.qpos[7:] = 0.0, attitude, q
        data.qvel[:3], data.qvel[3:6], data.qvel[6:] = 0.0, gyro, dq
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        total, touching = np.zeros(6), []
        root = data.xpos[robot.root_body_id]
        for sole, jacobian in zip(robot.soles, self._jacobians, strict=True):
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], root, sole.body_id)
            leg = np.flatnonzero(np.abs(jacobian[:, 6:]).max(axis=0) > 1e-9)
            rest = data.qfrc_bias[6:][leg] - data.qfrc_passive[6:][leg] - torque[leg]
            wrench = np.linalg.lstsq(jacobian[:, 6 + leg].T, rest, rcond=RANK)[0]
            touching.append(bool(wrench[2] > TOUCHES * robot.mass * robot.units.gravity))
            total += wrench * touching[-1]
        axes = data.xmat[robot.root_body_id].reshape(3, 3)
        return np.concatenate([axes.T @ total[:3], axes.T @ total[3:]]), touching
