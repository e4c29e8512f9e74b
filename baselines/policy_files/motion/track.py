"""The motion that a tracker follows: its frames, where the robot stands, and the terms of both."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .clips import FrameClip
from .config import MotionConfig

USUAL_ANCHOR = "torso_link"  # of trackers of the G1, where nothing names one


class TrackFrame(NamedTuple):
    """A frame of the motion in the world, and the robot's anchor now; n joints of the policy."""

    step: int  # of the clip
    share: float  # of the clip that is over, 0 to 1
    joints: np.ndarray  # (n,) [rad]
    velocities: np.ndarray  # (n,) [rad/s]
    default: np.ndarray  # (n,) of the policy [rad]
    root: np.ndarray  # (3,) [m]
    root_axes: np.ndarray  # (3, 3)
    root_velocity: np.ndarray  # (3,) [m/s], the world's axes
    root_rate: np.ndarray  # (3,) [rad/s], the root's axes
    anchor: np.ndarray  # (3,) [m]
    anchor_axes: np.ndarray  # (3, 3)
    robot_anchor: np.ndarray  # (3,) [m]
    robot_anchor_axes: np.ndarray  # (3, 3)


def _roll_pitch(axes: np.ndarray) -> np.ndarray:
    x, y, z = axes[2]
    return np.array([np.arctan2(y, z), np.arcsin(np.clip(-x, -1.0, 1.0))])


#: term → its numbers of a frame
MOTION_TERMS: dict[str, Callable[[TrackFrame], np.ndarray]] = {
    "motion_command": lambda f: np.concatenate([f.joints, f.velocities]),
    "motion_joint_pos": lambda f: f.joints,
    "motion_joint_pos_rel": lambda f: f.joints - f.default,
    "motion_joint_vel": lambda f: f.velocities,
    "motion_anchor_pos_b": lambda f: f.robot_anchor_axes.T @ (f.anchor - f.robot_anchor),
    "motion_anchor_ori_b": lambda f: (f.robot_anchor_axes.T @ f.anchor_axes)[:, :2].ravel(),
    "motion_root_height": lambda f: f.root[2:],
    "motion_root_roll_pitch": lambda f: _roll_pitch(f.root_axes),
    "motion_root_lin_vel": lambda f: f.root_axes.T @ f.root_velocity,
    "motion_root_ang_vel": lambda f: f.root_rate,
    "motion_gravity": lambda f: -f.root_axes[2],
    "motion_phase": lambda f: np.array([f.share]),
    "time_step": lambda f: np.array([float(f.step)]),
}
MOTION_ALIASES = {
    "motion_ref_pos_b": "motion_anchor_pos_b",
    "motion_ref_ori_b": "motion_anchor_ori_b",
    "ref_motion_phase": "motion_phase",
}
#: numbers of a term in a frame, where they are not three, nor of joints
MOTION_SIZES = {"motion_anchor_ori_b": 6, "motion_root_height": 1, "motion_root_roll_pitch": 2,
                "motion_phase": 1, "time_step": 1}  # fmt: skip
PER_JOINT = ("motion_joint_pos", "motion_joint_pos_rel", "motion_joint_vel")


@dataclass(frozen=True, eq=False)
class TrackedClip:
    """A clip with what follows of it: velocities of the root, and where the anchor is (T, …)."""

    clip: FrameClip
    root_axes: np.ndarray
    root_velocity: np.ndarray
    root_rate: np.ndarray
    anchor: np.ndarray
    anchor_axes: np.ndarray


class MotionTrack:
    """A clip that a tracker follows, as its terms see it.

    When a trial begins the clip is laid so that its first frame's anchor stands where the robot's
    does and faces as it does, by a turn about the vertical and a shift along the ground. Where it
    is not `plays` its first frame is held, at rest.

    Args:
        robot: that follows it.
        config: the anchor, and whose heading is compared with its.
        clip: a frame each policy step.
        index: (n,) joints of the policy among the robot's.
        default: (n,) posture of the policy [rad].

    Raises ConfigError for an anchor that is no body of the robot.
    """

    def __init__(
        self, robot: Robot, config: MotionConfig, clip: FrameClip, index: np.ndarray,
        default: np.ndarray, source: str = "",
    ):  # fmt: skip
        self.robot, self.config, self.index, self.default = robot, config, index, default
        names = [robot.model.body(i).name for i in range(robot.model.nbody)]
        anchor = config.anchor or (USUAL_ANCHOR if USUAL_ANCHOR in names else "")
        if anchor and anchor not in names:
            raise ConfigError(f"{robot.name!r} has no body {anchor!r}", source=source,
                              field="motion.anchor", choices=names)  # fmt: skip
        self.body = names.index(anchor) if anchor else robot.root_body_id
        self._data = mujoco.MjData(robot.model)
        self.course = self._course(clip)
        self.turn, self.shift = np.eye(3), np.zeros(3)
        self._robot_anchor, self._robot_axes, self._step = np.zeros(3), np.eye(3), 0

    def _course(self, clip: FrameClip) -> TrackedClip:
        count, period = len(clip.qpos), clip.period
        rates, anchors, axes, roots = [np.zeros((count, *shape)) for shape in (
            (3,), (3,), (3, 3), (3, 3))]  # fmt: skip
        data = self._data
        moved = np.zeros(self.robot.model.nv)
        for i, qpos in enumerate(clip.qpos):
            data.qpos[:] = qpos
            mujoco.mj_kinematics(self.robot.model, data)
            anchors[i], axes[i] = data.xpos[self.body], data.xmat[self.body].reshape(3, 3)
            roots[i] = data.xmat[self.robot.root_body_id].reshape(3, 3)
            first, second = max(i - 1, 0), min(i + 1, count - 1)
            if first != second:
                mujoco.mj_differentiatePos(self.robot.model, moved, (second - first) * period,
                                           clip.qpos[first], clip.qpos[second])  # fmt: skip
                rates[i] = moved[3:6]
        velocity = np.gradient(clip.qpos[:, :3], period, axis=0) if count > 1 else np.zeros((1, 3))
        return TrackedClip(clip, roots, velocity, rates, anchors, axes)

    def begin(self, state: RobotState) -> None:
        """Lay the clip where the robot stands, as it faces."""
        self._look(state)
        course = self.course
        own = course.root_axes[0] if self.config.heading == "root" else course.anchor_axes[0]
        turn = _yaw(self._robot_axes) - _yaw(own)
        cosine, sine = np.cos(turn), np.sin(turn)
        self.turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        self.shift = self._robot_anchor - self.turn @ course.anchor[0]
        self.shift[2] = 0.0

    def update(self, state: RobotState, step: int) -> None:
        """Take the robot as it is in this policy step."""
        self._look(state)
        self._step = step

    def place(self, ahead: int = 0) -> int:
        """The clip's frame that is shown now, or so many steps ahead."""
        now = self._step if self.config.plays else 0
        return min(max(now + ahead, 0), len(self.course.clip.qpos) - 1)

    def qpos(self, step: int) -> np.ndarray:
        """(nq,) a frame of the clip where it has been laid."""
        found: np.ndarray = self.course.clip.qpos[step].copy()
        found[:3] = self.turn @ found[:3] + self.shift
        turned = np.zeros(4)
        mujoco.mju_mat2Quat(turned, (self.turn @ self.course.root_axes[step]).ravel())
        found[3:7] = turned
        return found

    def frame(self, ahead: int = 0) -> TrackFrame:
        """The frame that is so many policy steps ahead; its first and last are held."""
        i, course = self.place(ahead), self.course
        moves = 1.0 if self.config.plays else 0.0
        last = max(1, len(course.clip.qpos) - 1)
        return TrackFrame(
            i, i / last, course.clip.qpos[i, 7:][self.index],
            moves * course.clip.velocities[i, self.index], self.default,
            self.turn @ course.clip.qpos[i, :3] + self.shift, self.turn @ course.root_axes[i],
            moves * (self.turn @ course.root_velocity[i]), moves * course.root_rate[i],
            self.turn @ course.anchor[i] + self.shift, self.turn @ course.anchor_axes[i],
            self._robot_anchor, self._robot_axes,
        )  # fmt: skip

    def _look(self, state: RobotState) -> None:
        """Where the robot's anchor is, by its joints and root."""
        data = self._data
        data.qpos[:] = state.qpos
        mujoco.mj_kinematics(self.robot.model, data)
        self._robot_anchor = data.xpos[self.body].copy()
        self._robot_axes = data.xmat[self.body].reshape(3, 3).copy()


def _yaw(axes: np.ndarray) -> float:
    return float(np.arctan2(axes[1, 0], axes[0, 0]))


def frames_ahead(ahead: Sequence[int]) -> tuple[int, ...]:
    """The frames that a term shows: those said, or the present one."""
    return tuple(ahead) or (0,)
