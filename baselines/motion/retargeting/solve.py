"""Postures of a robot that meet targets frame by frame, by mink, with planted soles."""

import time
from typing import NamedTuple

import mink
import mujoco
import numpy as np
import qpsolvers

from poise.configs.errors import PoiseError
from poise.envs.robots.robot import Robot

from .clearance import ClearanceLimit
from .limbs import Limbs, sole_corners
from .targets import BodyTargets, low_pass
from .tasks import FrameTasks, SolesTask

PLANTING = 3  # iterations from near postures to planted soles
MARGIN = 0.005  # [rad] kept from the joint limits, for splines between the frames
MOST, STEP = 10, 1e-3  # iterations, and the largest move [rad, m] that ends them
LEAST_DAMPING, MOST_DAMPING = 1e-4, 10.0
NEAR = 0.02  # [rad] that planting may move a joint by in any case
CLOSE = 1e-3  # [m] by which a sole is off at most where it is planted
SOLES = 100.0  # weight of their errors [m, rad] where steps are compared, and of lacking clearance


class Solved(NamedTuple):
    """Postures of all frames, and what they miss.

    Attributes:
        qpos: (F, nq).
        sole_error: largest distance of a sole's corner from where it is planted [m].
        direction_error: segment → root mean square of the angle to its target [rad].
        penetration: largest depth of a link in the floor or in another link [m].
        time_per_frame: of the processor, median [s].
    """

    qpos: np.ndarray
    sole_error: float
    direction_error: dict[str, float]
    penetration: float
    time_per_frame: float


def solve_frames(robot: Robot, limbs: Limbs, targets: BodyTargets, smooth: float) -> Solved:
    """One QP after the other per frame, each begun where the last frame ended.

    min Σ‖W (J Δq + e)‖² over the segments, the height of the hips, the horizontal place of the CoM,
    and the standing posture, s.t. J_soles Δq = −e_soles, the joint limits and the clearance from
    the floor and between links: where a limit is met the other joints make up for it, nothing is
    cut. A step that makes things worse is taken back
    and tried again with more damping (Levenberg and Marquardt). The joints are then low-passed at
    `smooth` [Hz], and the nearest postures with planted soles are what remains.

    Raises PoiseError if a QP has no solution.
    """
    return FrameIk(robot, limbs, list(targets.directions)).solve_all(targets, smooth)


def plant(robot: Robot, limbs: Limbs, qpos: np.ndarray, close: float = 1e-5) -> np.ndarray:
    """(F, nq) postures near others, with both soles where the robot stands, within joint limits.

    A posture whose soles are as far from each other as they are to be is moved as a whole; where a
    sole is then off by more than `close` [m], or a joint out of its range, the nearest posture
    with planted soles is taken.

    Raises PoiseError if there is none.
    """
    ik, made = FrameIk(robot, limbs, []), np.empty_like(qpos)
    low, high = robot.joint_range[:, 0] + MARGIN, robot.joint_range[:, 1] - MARGIN
    sole = robot.soles[0]
    wanted = ik.configuration.data
    place, axes = wanted.xpos[sole.body_id].copy(), wanted.xquat[sole.body_id].copy()
    for frame, given in enumerate(qpos):
        joints = np.clip(given[7:], low, high)
        ik.configuration.update(np.concatenate([robot.standing_qpos[:7], joints]))
        root = _root_for(ik.configuration.data, sole.body_id, place, axes, robot.standing_qpos)
        made[frame] = np.concatenate([root, joints])
        ik.configuration.update(made[frame])
        if ik.sole_error() > close:
            made[frame] = ik.planted_near(made[frame])
    return made


def _root_for(
    data: mujoco.MjData, body: int, place: np.ndarray, axes: np.ndarray, standing: np.ndarray
) -> np.ndarray:
    """(7,) place and orientation of the root at which a body is at a place, turned as `axes`."""
    turn, back = np.empty(4), np.empty(4)
    mujoco.mju_negQuat(back, data.xquat[body])
    mujoco.mju_mulQuat(turn, axes, back)
    moved, root = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(moved, standing[:3] - data.xpos[body], turn)
    mujoco.mju_mulQuat(root, turn, standing[3:7])
    return np.concatenate([place + moved, root])


class FrameIk:
    """The tasks of one robot, from frame to frame."""

    first = 1  # times that the first frame is solved

    def __init__(self, robot: Robot, limbs: Limbs, names: list[str]):
        self.robot, self.model = robot, robot.model
        self.frame = FrameTasks(robot, limbs, names)
        self.configuration = self.frame.configuration
        self.planted = [sole_corners(robot, self.configuration.data, i) for i in range(2)]
        self.near = mink.PostureTask(self.model, 1.0)
        self.soles = SolesTask([sole.body for sole in robot.soles], self.configuration)
        self.damping = LEAST_DAMPING
        self.clearance = ClearanceLimit(robot, self.configuration.data)
        self.limits = [mink.ConfigurationLimit(self.model, 1.0, MARGIN), self.clearance]

    def solve_all(self, targets: BodyTargets, cutoff: float) -> Solved:
        """All frames: solved, low-passed at `cutoff` [Hz], planted and measured."""
        qpos, times = np.empty((len(targets), self.model.nq)), np.zeros(len(targets))
        for frame in range(len(targets)):
            begin = time.thread_time()
            self.tread(frame)
            for _ in range(1 if frame else self.first):
                qpos[frame] = self.solve(targets, frame)
            times[frame] += time.thread_time() - begin
        wanted = self.smoothed(qpos, cutoff)
        angles, sole_error, penetration = [], 0.0, 0.0
        for frame in range(len(targets)):
            begin = time.thread_time()
            self.tread(frame)
            qpos[frame] = self.nearer(qpos[frame], wanted[frame])
            times[frame] += time.thread_time() - begin
            self.frame.aim(targets, frame)
            angles.append(self.frame.angles())
            sole_error = max(sole_error, self.sole_error())
            penetration = max(penetration, self.clearance.depth(self.configuration.data))
        rms = np.sqrt(np.mean(np.square(angles), axis=0)).tolist()
        errors = dict(zip(targets.directions, rms, strict=True))
        return Solved(qpos, sole_error, errors, penetration, float(np.median(times)))

    def tread(self, frame: int) -> None:
        """Take where soles are in a frame as targets: here they stay."""

    def smoothed(self, qpos: np.ndarray, cutoff: float) -> np.ndarray:
        """(F, nq) the postures, their joints low-passed."""
        return np.concatenate([qpos[:, :7], low_pass(qpos[:, 7:], cutoff)], axis=1)

    def solve(self, targets: BodyTargets, frame: int) -> np.ndarray:
        """(nq,) the posture of a frame."""
        self.frame.aim(targets, frame)
        damping, merit = self.damping, self._merit()
        for _ in range(MOST):
            before, step = self.configuration.q.copy(), self._step(self.frame.tasks, damping)
            self.configuration.integrate_inplace(step, 1.0)
            after = self._merit()
            if after <= merit * (1.0 + 1e-9) + 1e-12:
                merit, damping = after, max(0.2 * damping, LEAST_DAMPING)
            else:
                self.configuration.update(before)
                damping = min(10.0 * damping, MOST_DAMPING)
            if np.abs(step).max() < STEP:
                break
        self.damping = damping
        return self.configuration.q.copy()

    def planted_near(self, qpos: np.ndarray) -> np.ndarray:
        """(nq,) the posture with planted soles that is nearest to one."""
        self.configuration.update(qpos)
        tasks = self.near_tasks()
        for _ in range(PLANTING):
            step = self._step(tasks, LEAST_DAMPING)
            self.configuration.integrate_inplace(step, 1.0)
        return self.configuration.q.copy()

    def nearer(self, solved: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """(nq,) the posture near `wanted` with planted soles, or the one that was `solved` where
        that is nearer, or the former's soles are off their places.

        Joints at their limits leave legs no room: then planting moves them far, or in vain.
        """
        planted = self.planted_near(wanted)
        moved, own = (np.abs(each[7:] - wanted[7:]).max() for each in (planted, solved))
        if moved <= max(own, NEAR) and self.sole_error() < CLOSE:
            return planted
        self.configuration.update(solved)
        if self.sole_error() < CLOSE:
            return solved
        self.configuration.update(planted)
        return planted

    def near_tasks(self) -> list[mink.Task]:
        """What keeps a posture near to the one that it is begun at."""
        self.near.set_target(self.configuration.q)
        return [self.near]

    def _step(self, tasks: list[mink.Task], damping: float) -> np.ndarray:
        """(nv,) the displacement of one QP."""
        for parting in (True, False):  # soles and limits may leave no room to part
            self.clearance.parting = parting
            held = [self.soles] if self.soles.feet else None
            problem = mink.build_ik(self.configuration, tasks, 1.0, damping, limits=self.limits,
                                    constraints=held)  # fmt: skip
            step = qpsolvers.solve_problem(problem, solver="daqp").x
            if step is not None:
                return step
        raise PoiseError(f"no posture of {self.robot.name!r} near this one keeps its soles "
                         "where they stand within the joint limits")  # fmt: skip

    def _merit(self) -> float:
        """Σ‖W e‖² of the tasks and, heavily, of the soles and of what lacks in clearance: what a
        step must make smaller."""
        errors = [self.frame.errors()]
        errors.append(SOLES * self.clearance.lacking(self.configuration.data))
        errors.append(SOLES * self.soles.whole_error(self.configuration))
        return float(sum(error @ error for error in errors))

    def sole_error(self) -> float:
        """Largest distance of a corner of a sole from where it is planted [m]."""
        data = self.configuration.data
        gaps = [sole_corners(self.robot, data, i) - self.planted[i] for i in range(2)]
        return float(max(np.linalg.norm(gap, axis=1).max() for gap in gaps))
