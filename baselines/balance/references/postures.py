"""Where soles, centre of mass and root of a posture are; whether its joints are in their range."""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.compiled.copies import Copyable
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose


class LevelPosture(NamedTuple):
    """A posture with its soles level and their mean at the origin, in the heading frame."""

    com: np.ndarray  # (3,) [m]
    root_axes: np.ndarray  # (3, 3) root orientation


def most_beyond(robot: Robot, joints: np.ndarray) -> tuple[int, int, float]:
    """Frame and joint of postures (F, nj) that is furthest beyond its range, and by how much; not
    above 0 where all are within."""
    low, high = robot.joint_range.T
    beyond = np.maximum(low - joints, joints - high)
    frame, joint = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    return int(frame), int(joint), float(beyond[frame, joint])


class LevelKinematics(Copyable):
    """Forward kinematics of joint positions alone: the feet, not the root, say where it is.

    `data` holds MuJoCo's kinematics of the last posture, with the root where it stands.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self.data = mujoco.MjData(robot.model)
        self.data.qpos[:] = robot.standing_qpos
        self.standing = self.posture(robot.standing_qpos[7:])

    def posture(self, q: np.ndarray) -> LevelPosture:
        """CoM and root orientation for joint positions `q` (nj,).

        Up is the mean of the sole normals, forward the mean of the soles' forward axes.
        """
        robot, data = self.robot, self.data
        data.qpos[7:] = q
        mujoco.mj_kinematics(robot.model, data)
        mujoco.mj_comPos(robot.model, data)
        origin, forward, up = np.zeros(3), np.zeros(3), np.zeros(3)
        for sole in robot.soles:
            point, axes = sole_pose(data, sole)
            origin += point / len(robot.soles)
            forward += axes[:, 0]
            up += axes[:, 2]
        up /= np.linalg.norm(up)
        left = _cross(up, forward)
        left /= np.linalg.norm(left)
        axes = np.array([_cross(left, up), left, up])  # rows: the heading frame
        com = axes @ (data.subtree_com[robot.root_body_id] - origin)
        return LevelPosture(com, axes @ data.xmat[robot.root_body_id].reshape(3, 3))

    def root_rotation(self, posture: LevelPosture) -> np.ndarray:
        """Rotation vector φ (3,) [rad], heading frame: root_axes = exp(φ) · standing root_axes."""
        return Rotation.from_matrix(posture.root_axes @ self.standing.root_axes.T).as_rotvec()

    def support_extent(self) -> np.ndarray:
        """(2,) half sizes of the box around both soles, forward and left, when standing [m]."""
        robot, data = self.robot, self.data
        self.posture(robot.standing_qpos[7:])
        corners = [
            data.xpos[sole.body_id]
            + (np.pad(sole.polygon, ((0, 0), (0, 1))) @ sole.rotation.T + sole.position)
            @ data.xmat[sole.body_id].reshape(3, 3).T
            for sole in robot.soles
        ]
        return 0.5 * np.ptp(np.concatenate(corners), axis=0)[:2]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b of vectors (3,): NumPy's takes longer than all the rest of a posture."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
