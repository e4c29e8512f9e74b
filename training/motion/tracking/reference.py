"""Where the bodies of a robot are while it follows a motion exactly, on its soles as they stand."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.footing import Footing
from poise.baselines.balance.references.postures import LevelKinematics
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

MOST, CLOSE = 10, 1e-5  # iterations, and the error [m, rad] that ends them
RANK = 1e-3  # of the largest singular value: legs that cannot reach a sole do not try


class SolePlaces(NamedTuple):
    """Where both soles are: points (2, 3) [m], axes (2, 3, 3), heading (cos, sin) of the mean."""

    points: np.ndarray
    axes: np.ndarray
    heading: np.ndarray

    @classmethod
    def of(cls, state: RobotState) -> SolePlaces:
        """Return the stance of a robot at this moment."""
        return cls(state.sole_points.copy(), state.sole_axes.copy(), state.heading.copy())

    @property
    def origin(self) -> np.ndarray:
        """(3,) the middle of the soles [m]."""
        return self.points.mean(axis=0)

    @property
    def turn(self) -> np.ndarray:
        """(3, 3) axes of the heading frame, as columns."""
        cos, sin = self.heading
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


class ReferenceBodies:
    """Joints and bodies of a motion at a time, for soles that stand where they do.

    Attributes:
        bodies: (n,) bodies that are compared: the robot's own, which move.
        led: joints that follow the motion: all, but of a walk by commands those of trunk and arms.
        com: (3,) where the CoM is to be, at the last time that was asked for [m].
        origin, turn: (3,), (3, 3) of the motion's frame then: that of the soles as they stand, or
            the one that a motion with steps has of its own.
    """

    def __init__(self, motion: ReferenceMotion, robot: Robot):
        self.motion, self.robot = motion, robot
        self._kinematics, self._data = LevelKinematics(robot), mujoco.MjData(robot.model)
        model = robot.model
        moving = model.body_weldid == np.arange(model.nbody)
        moving[0] = False
        self.bodies = np.flatnonzero(moving)
        self._legs = _leg_dofs(robot)
        own = np.setdiff1d(np.arange(model.nv - 6), self._legs - 6)
        self.led: slice | np.ndarray = slice(None) if motion.commands is None else own
        self._correction = np.zeros(len(self._legs))  # where the last search ended
        self.com, self.origin, self.turn = np.zeros(3), np.zeros(3), np.eye(3)

    def at(self, time: float, stance: SolePlaces) -> tuple[np.ndarray, np.ndarray]:
        """Joints (nj,) [rad] as the motion has them and places of the bodies (n, 3) [m].

        Trunk, arms, the root's orientation and the CoM are the motion's, in the heading frame of
        the soles. The legs are those that reach the soles where these are: a foot that has come
        down elsewhere than in the standing posture is no error of the bodies above it. Of a motion
        with steps the legs are the motion's, too, from the soles that are planted.
        """
        if self.motion.footing is not None:
            return self._on_planted_soles(self.motion.footing, time, stance)
        sample, data = self.motion.sample(time), self._data
        posture = self._kinematics.posture(sample.q_ref)
        turn, free = stance.turn, np.array([0, 1, 2, *self._legs])
        self.origin, self.turn = stance.origin, turn
        data.qpos[7:] = sample.q_ref
        data.qpos[self._legs + 1] += self._correction
        mujoco.mju_mat2Quat(data.qpos[3:7], np.ascontiguousarray(turn @ posture.root_axes).ravel())
        self.com = stance.origin + turn @ posture.com
        data.qpos[:3] = self.com
        for _ in range(MOST):
            error, jacobian = self._miss(stance, self.com)
            if np.abs(error).max() < CLOSE:
                break
            step = np.linalg.lstsq(jacobian[:, free], -error, rcond=RANK)[0]
            data.qpos[:3] += step[:3]
            data.qpos[self._legs + 1] += step[3:]
        self._correction = data.qpos[self._legs + 1] - sample.q_ref[self._legs - 6]
        return sample.q_ref, data.xpos[self.bodies].copy()

    def _on_planted_soles(
        self, footing: Footing, time: float, stance: SolePlaces
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same of a motion with steps, whose own frame is put on the soles that are planted."""
        data, sample, joints = self._data, footing.sample(time), self.motion.sample(time).q_ref
        down = sample.planted if sample.planted.any() else ~sample.planted
        ahead = stance.axes[down][:, :2, 0].sum(axis=0)
        wanted = sample.turns[down][:, 0, 2].mean()
        yaw = float(np.arctan2(ahead[1], ahead[0]) - wanted)
        turn = Rotation.from_rotvec([0.0, 0.0, yaw])
        standing = self._kinematics.standing.root_axes
        axes = (turn * Rotation.from_rotvec(sample.root[0])).as_matrix() @ standing
        mujoco.mju_mat2Quat(data.qpos[3:7], np.ascontiguousarray(axes).ravel())
        places = turn.apply(sample.places[down][:, 0])
        origin = (stance.points[down] - places).mean(axis=0)
        self.origin, self.turn = origin, turn.as_matrix()
        self.com = origin + turn.apply(sample.com[0])
        data.qpos[:3], data.qpos[7:] = self.com, joints
        for _ in range(2):  # the second time the bodies are there
            mujoco.mj_kinematics(self.robot.model, data)
            mujoco.mj_comPos(self.robot.model, data)
            data.qpos[:3] += self.com - data.subtree_com[self.robot.root_body_id]
        return joints, data.xpos[self.bodies].copy()

    @property
    def posture(self) -> np.ndarray:
        """(nq,) the posture at the last time that was asked for."""
        return self._data.qpos.copy()

    def poses(self, time: float, stance: SolePlaces) -> tuple[np.ndarray, np.ndarray]:
        """Where all bodies are at a time [s], about soles that stand as in `stance`.

        Returns:
            positions (nbody, 3) [m] and quaternions (nbody, 4), w first, world axes.
        """
        self.at(time, stance)
        return self._data.xpos.copy(), self._data.xquat.copy()

    def _miss(self, stance: SolePlaces, com: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (15,) misses of CoM and soles [m, rad], and their (15, nv) Jacobian."""
        robot, data, model = self.robot, self._data, self.robot.model
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        error, jacobian, quaternion = np.zeros(15), np.zeros((15, model.nv)), np.zeros(4)
        error[:3] = data.subtree_com[robot.root_body_id] - com
        mujoco.mj_jacSubtreeCom(model, data, jacobian[:3], robot.root_body_id)
        for i, sole in enumerate(robot.soles):
            rows = slice(3 + 6 * i, 6 + 6 * i), slice(6 + 6 * i, 9 + 6 * i)
            axes = data.xmat[sole.body_id].reshape(3, 3)
            point = data.xpos[sole.body_id] + axes @ sole.position
            error[rows[0]] = point - stance.points[i]
            between = axes @ sole.rotation @ stance.axes[i].T
            mujoco.mju_mat2Quat(quaternion, between.ravel())
            mujoco.mju_quat2Vel(error[rows[1]], quaternion, 1.0)
            mujoco.mj_jac(model, data, jacobian[rows[0]], jacobian[rows[1]], point, sole.body_id)
        return error, jacobian


def _leg_dofs(robot: Robot) -> np.ndarray:
    """Return the degrees of freedom that move one sole and not the other."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    moved = []
    for sole in robot.soles:
        turns = np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, None, turns, sole.body_id)
        moved.append(np.any(turns != 0.0, axis=0))
    return np.flatnonzero(np.logical_xor(*moved))
