"""A motion of joints as a motion of the whole robot whose soles stay where they are."""

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np

from poise.baselines.balance.references.postures import LevelKinematics
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.envs.compiled.maths.polygons import convex_hull
from poise.envs.physics.arrays import robot_arrays, sim_views
from poise.envs.physics.kinematics import allocate_state, update_state
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

#: joint positions, velocities and accelerations (nj,) at a time [s]
Joints = Callable[[float], tuple[np.ndarray, np.ndarray, np.ndarray]]


class Trajectory(NamedTuple):
    """A robot's motion in n samples: positions, velocities, and what the ground must do.

    Attributes:
        times: (n,) [s].
        qpos, qvel, qacc: (n, nq), (n, nv), (n, nv).
        com: (n, 3) c [m]; com_acc: (n, 3) c̈ [m/s²].
        wrench: (n, 6) of the ground, force [N] and moment about c [N·m]: A v̇ + Ȧ v − m g.
        motors: (n, nu) torques M v̇ + h of the motors if no ground were there [N·m].
        jacobians: (n, 6 nc, nv) of the soles, linear then angular, at their points.
        sole_points: (n, nc, 3) [m]; sole_axes: (n, nc, 3, 3); corners: (n, k, 3) of all [m].
        height: of the plane of the soles [m].
        planted: (n, nc) bool, which soles bear.
    """

    times: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    qacc: np.ndarray
    com: np.ndarray
    com_acc: np.ndarray
    wrench: np.ndarray
    motors: np.ndarray
    jacobians: np.ndarray
    sole_points: np.ndarray
    sole_axes: np.ndarray
    corners: np.ndarray
    height: float
    planted: np.ndarray

    @property
    def zmp(self) -> np.ndarray:
        """(n, 2) where the ground's wrench has no horizontal moment [m].

        p = c − [(h f_x + n_y)/f_z, (h f_y − n_x)/f_z], h the height of c over the soles.
        """
        f, n = self.wrench[:, :3], self.wrench[:, 3:]
        h = self.com[:, 2] - self.height
        lever = np.column_stack([h * f[:, 0] + n[:, 1], h * f[:, 1] - n[:, 0]]) / f[:, 2:]
        return np.asarray(self.com[:, :2] - lever)

    @property
    def support(self) -> np.ndarray:
        """(k, 2) hull of the soles in the first sample, counter-clockwise [m]."""
        points = self.corners[0, :, :2].copy()
        hull = np.empty((2 * len(points) + 1, 2))
        return hull[: convex_hull(points, len(points), 1e-6, hull)].copy()


def joints_of(motion: ReferenceMotion) -> Joints:
    """The joints of a reference motion as a function of time."""
    return lambda time: motion.sample(time)[:3]


class PlantedRobot:
    """A robot of which joints alone are known: its soles say where it is and how it moves.

    The middle of the soles is where it is in standing, level and facing forward. The root's
    velocity is the one for which the soles rest, J_r v_r = −J_q q̇ in least squares; its
    acceleration is that of J_r v̇_r = −J_q q̈ − J̇ v.
    """

    def __init__(self, robot: Robot):
        self.robot, self.arrays = robot, robot_arrays(robot)
        self.data = mujoco.MjData(robot.model)
        self._views = sim_views(robot.model, self.data)
        self._state = allocate_state(robot.model.nv, len(robot.soles), robot.model.nbody)
        self._level = LevelKinematics(robot)
        self._origin = self._middle(robot.standing_qpos)

    @property
    def ground(self) -> float:
        """Height of the plane of the soles [m]."""
        return float(self._origin[2])

    @property
    def state(self) -> RobotState:
        """Every quantity of the last `at`; overwritten by the next."""
        return RobotState(self.arrays, self._state)

    def at(self, q: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """(nv,) v̇; afterwards `state` is that of these joints, velocities included."""
        data, nv = self.data, self.robot.model.nv
        data.qpos[:] = self.placed(q)
        mujoco.mj_kinematics(self.robot.model, data)
        mujoco.mj_comPos(self.robot.model, data)
        rows = self._rows()
        data.qvel[6:] = rate
        data.qvel[:6] = _least(rows[:, :6], -rows[:, 6:] @ rate)
        self._update()
        J, vdot = self._state.J, np.empty(nv)
        vdot[6:] = acceleration
        vdot[:6] = _least(J[:, :6], -J[:, 6:] @ acceleration - self._state.Jdot_v)
        return vdot

    def put(self, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Let `state` be that of a posture (nq,) and velocities (nv,)."""
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        self._update()

    def _update(self) -> None:
        self.data.ctrl[:] = 0.0
        mujoco.mj_step1(self.robot.model, self.data)
        update_state(self.arrays, self._views, self._state)

    def placed(self, q: np.ndarray) -> np.ndarray:
        """(nq,) with the root where the soles have it."""
        posture = self._level.posture(q)
        com = self._level.data.subtree_com[self.robot.root_body_id]
        away = self._level.data.xpos[self.robot.root_body_id] - com
        turn = posture.root_axes @ self._level.data.xmat[self.robot.root_body_id].reshape(3, 3).T
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(posture.root_axes).ravel())
        return np.concatenate([self._origin + posture.com + turn @ away, quaternion, q])

    def _middle(self, qpos: np.ndarray) -> np.ndarray:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.robot.model, self.data)
        return np.mean([self._point(i) for i in range(len(self.robot.soles))], axis=0)

    def _point(self, foot: int) -> np.ndarray:
        sole = self.robot.soles[foot]
        axes = self.data.xmat[sole.body_id].reshape(3, 3)
        return np.asarray(self.data.xpos[sole.body_id] + axes @ sole.position)

    def _rows(self) -> np.ndarray:
        """(6 nc, nv) Jacobian of the soles."""
        model, rows = self.robot.model, np.zeros((6 * len(self.robot.soles), self.robot.model.nv))
        for i, sole in enumerate(self.robot.soles):
            linear, angular = rows[6 * i : 6 * i + 3], rows[6 * i + 3 : 6 * i + 6]
            mujoco.mj_jac(model, self.data, linear, angular, self._point(i), sole.body_id)
        return rows


def sample_trajectory(planted: PlantedRobot, joints: Joints, times: np.ndarray) -> Trajectory:
    """The whole robot at `times` (n,) [s] of a motion of its joints."""
    return record_robot(planted, times, lambda time: planted.at(*joints(time)))


def record_robot(
    planted: PlantedRobot, times: np.ndarray, put: Callable[[float], np.ndarray]
) -> Trajectory:
    """The whole robot at `times` (n,) [s]: `put` puts it there, and returns its v̇ (nv,)."""
    robot, s, rows = planted.robot, planted._state, []
    times = np.asarray(times, dtype=float)
    for time in times:
        vdot = put(time)
        wrench = s.A @ vdot + s.A_bias
        com_acc = wrench[:3] / robot.mass - [0.0, 0.0, robot.units.gravity]
        motors = (s.M @ vdot + s.h)[robot.motor_dofs]
        corners = [s.sole_point[i] + sole.polygon @ s.sole_axes[i, :, :2].T
                   for i, sole in enumerate(robot.soles)]  # fmt: skip
        row = (s.qpos, s.qvel, vdot, s.com, com_acc, wrench, motors, s.J, s.sole_point, s.sole_axes,
               np.concatenate(corners))  # fmt: skip
        rows.append([np.array(part) for part in row])  # the state changes
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    bear = np.ones((len(times), len(robot.soles)), bool)
    return Trajectory._make([times, *columns, planted.ground, bear])


def _least(rows: np.ndarray, values: np.ndarray) -> np.ndarray:
    """x (6,) of least ‖A x − b‖ for rows A (m, 6) of a root, which are always independent."""
    return np.asarray(np.linalg.solve(rows.T @ rows, rows.T @ values))
