"""Postures with a given centre of mass, trunk and arms whose legs reach the soles."""

from collections.abc import Sequence
from functools import lru_cache

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.compiled.maths.polygons import clipped
from poise.envs.physics.legs import standing_data
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose

from .postures import LevelKinematics

MOST, CLOSE = 15, 1e-7  # iterations, and the error [m, rad] that ends them
FURTHEST = 0.3  # [m, rad] of a step
RANK = 1e-3  # of the largest singular value: legs that cannot reach a sole do not try
SMALL = 1e-6  # [rad] by which φ is turned for its derivative


class PlantedLegs:
    """Inverse kinematics of the legs of one robot, whose soles are where it stands, or elsewhere.

    Attributes:
        legs: (k,) entries of q that move one sole and not the other.
        others: (nj − k,) the other joints.
        standing_soles: points and axes of the soles in standing, see `sole_pose`.
    """

    def __init__(self, robot: Robot):
        self.robot, self._data = robot, standing_data(robot)
        self._standing = LevelKinematics(robot).standing
        dofs = _leg_dofs(robot, self._data)
        self.legs = dofs - 6
        self.others = np.setdiff1d(np.arange(len(robot.joint_names)), self.legs)
        self.standing_soles = [sole_pose(self._data, sole) for sole in robot.soles]
        self._middle = np.mean([point for point, _ in self.standing_soles], axis=0)
        self._free = np.array([0, 1, 2, *dofs])
        self._away, self._upright = np.zeros(3), np.zeros(4)  # of the root from the CoM, of late
        mujoco.mju_mat2Quat(self._upright, self._standing.root_axes.ravel())

    def reach(
        self, com: np.ndarray, root: np.ndarray, others: np.ndarray, guess: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """The posture (nq,) and the largest error [m, rad] of CoM and soles that is left.

        `com` (3,) is that of a `MotionSample`: relative to the middle of the soles and, over the
        ground, to that of the standing posture; `root` (3,) its φ; `others` the joints that are no
        legs; `guess` (nj,) what the search begins with.
        """
        com = self._middle + com + self._standing.com * [1.0, 1.0, 0.0]
        return self.reach_soles(com, root, others, guess, self.standing_soles)

    def reach_soles(
        self,
        com: np.ndarray,
        root: np.ndarray,
        others: np.ndarray,
        guess: np.ndarray,
        soles: Sequence[tuple[np.ndarray, np.ndarray]],
    ) -> tuple[np.ndarray, float]:
        """The same for a CoM `com` (3,) in the world [m], and `soles`: points (3,), axes (3, 3)."""
        data = self._data
        angle, turn = float(np.linalg.norm(root)), np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, root / max(angle, 1e-12), angle)
        mujoco.mju_mulQuat(data.qpos[3:7], turn, self._upright)
        data.qpos[7:] = guess
        data.qpos[7 + self.others] = others
        data.qpos[:3] = com + self._away
        for i in range(MOST + 1):
            error, jacobian = self._miss(com, soles)
            if np.abs(error).max() < CLOSE or i == MOST:
                break
            step = np.linalg.lstsq(jacobian[:, self._free], -error, rcond=RANK)[0]
            step *= min(1.0, FURTHEST / float(np.abs(step).max()))
            data.qpos[:3] += step[:3]
            data.qpos[7 + self.legs] += step[3:]
        self._away = data.qpos[:3] - com
        return data.qpos.copy(), float(np.abs(error).max())

    def sensitivity(self, root: np.ndarray) -> np.ndarray:
        """(k, 6) how the legs of the last `reach` change with the CoM and with φ, `root`."""
        _, jacobian = self._miss(np.zeros(3), self.standing_soles)
        now = Rotation.from_rotvec(root)
        turns = [(now.inv() * Rotation.from_rotvec(root + SMALL * axis)).as_rotvec() / SMALL
                 for axis in np.eye(3)]  # fmt: skip
        body = self._standing.root_axes.T @ np.array(turns).T  # in the root's axes
        wanted = np.zeros((len(jacobian), 6))
        wanted[:3, :3] = np.eye(3)
        wanted[:, 3:] = -jacobian[:, 3:6] @ body
        return np.asarray(np.linalg.lstsq(jacobian[:, self._free], wanted, rcond=RANK)[0][3:])

    def _miss(
        self, com: np.ndarray, soles: Sequence[tuple[np.ndarray, np.ndarray]]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Misses of CoM and soles [m, rad], and their Jacobian."""
        robot, data, model = self.robot, self._data, self.robot.model
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        count = 3 + 6 * len(robot.soles)
        error, jacobian, quaternion = np.zeros(count), np.zeros((count, model.nv)), np.zeros(4)
        error[:3] = data.subtree_com[robot.root_body_id] - com
        mujoco.mj_jacSubtreeCom(model, data, jacobian[:3], robot.root_body_id)
        for i, (wanted, wanted_axes) in enumerate(soles):
            point, axes = sole_pose(data, robot.soles[i])
            at = 3 + 6 * i
            error[at : at + 3] = point - wanted
            mujoco.mju_mat2Quat(quaternion, (axes @ wanted_axes.T).ravel())
            mujoco.mju_quat2Vel(error[at + 3 : at + 6], quaternion, 1.0)
            mujoco.mj_jac(model, data, jacobian[at : at + 3], jacobian[at + 3 : at + 6], point,
                          robot.soles[i].body_id)  # fmt: skip
        return error, jacobian


def _leg_dofs(robot: Robot, data: mujoco.MjData) -> np.ndarray:
    moved = []
    for sole in robot.soles:
        turns = np.zeros((3, robot.model.nv))
        mujoco.mj_jacBody(robot.model, data, None, turns, sole.body_id)
        moved.append(np.any(turns != 0.0, axis=0))
    return np.flatnonzero(np.logical_xor(*moved))


def nominal_feet(robot: Robot) -> np.ndarray:
    """(2, 3) middles of the soles in the standing posture, which faces along x [m]."""
    data = standing_data(robot)
    return np.array([sole_pose(data, sole)[0] for sole in robot.soles])


def foot_signs(robot: Robot) -> np.ndarray:
    """(2,) 1 for the left foot, −1 for the right one, in the standing posture."""
    feet = nominal_feet(robot)
    sign = 1.0 if feet[0, 1] > feet[1, 1] else -1.0
    return np.array([sign, -sign])


@lru_cache(maxsize=16)
def ankle_limits(robot: Robot, sole: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """N (k, 2), o (k,), b (k,): |N p − o| ≤ b/λ for a CoP p [m, sole frame] under a load of λ m g.

    One row for each motor joint of the foot itself: the moment of a vertical force about its axis
    in the standing posture, over its torque limit.
    """
    model, foot = robot.model, robot.soles[sole]
    data = standing_data(robot)
    point, R = sole_pose(data, foot)
    normals, offsets, bounds = [], [], []
    for joint in np.flatnonzero(model.jnt_bodyid == foot.body_id):
        motor = np.flatnonzero(robot.motor_dofs == model.jnt_dofadr[joint])
        if len(motor) == 0:
            continue
        axis, anchor = data.xaxis[joint], data.xanchor[joint]
        # (axis × (point + R p − anchor))_z, affine in p
        offsets.append(-np.cross(axis, point - anchor)[2])
        normals.append([np.cross(axis, R[:, a])[2] for a in range(2)])
        bounds.append(robot.torque_limit[motor[0]] / robot.units.force)
    return np.reshape(normals, (-1, 2)), np.array(offsets), np.array(bounds)


def bearing_polygon(robot: Robot, sole: int, load: float, fraction: float) -> np.ndarray:
    """(k, 2) where a sole under a `load` [m g] can have its CoP, in its own frame [m].

    Only `fraction` of the polygon and of the ankles' torques counts.
    """
    polygon = fraction * robot.soles[sole].polygon
    for normal, offset, bound in zip(*ankle_limits(robot, sole), strict=True):
        room = fraction * bound / max(load, 1e-3)
        polygon = clipped(polygon, normal, offset + room)
        polygon = clipped(polygon, -normal, room - offset)
    return polygon
