"""Clips of a robot's motion as trackers are given them: one frame of root and joints a step."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from poise.baselines.balance.references.robot_clip import ABOUT, check_clip_robot, read_robot_clip
from poise.configs.archives import read_archive, read_arrays, read_names
from poise.configs.errors import ConfigError
from poise.configs.reading import MIB, parsing, read_text
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose

LAFAN_RATE = 30.0  # [Hz] of a .csv that says none, as the retargeted LAFAN1 set has it
CSV_BYTES = 64 * MIB
FRAMES = 100_000  # at most; half an hour at 50 Hz
LARGEST = 1e4  # [m, rad, rad/s]
NPZ = ("joint_pos", "joint_vel", "body_pos_w", "body_quat_w")  # of Isaac Lab's and mjlab's tracking


class ClipFrames(NamedTuple):
    """Frames as a file has them, `rate` [Hz] of them a second; joints in the file's own order."""

    rate: float
    root: np.ndarray  # (T, 3) [m]
    quat: np.ndarray  # (T, 4) wxyz
    joints: np.ndarray  # (T, n) [rad]
    velocities: np.ndarray | None  # (T, n) [rad/s]; None: not in the file


@dataclass(frozen=True, eq=False)
class FrameClip:
    """A motion of a robot, one frame each `period` [s].

    Attributes:
        qpos: (T, nq) as MuJoCo has them.
        velocities: (T, nj) of the joints [rad/s].
    """

    name: str
    period: float
    qpos: np.ndarray
    velocities: np.ndarray

    @property
    def duration(self) -> float:
        """Time of the last frame [s]."""
        return (len(self.qpos) - 1) * self.period


def standing_clip(robot: Robot, period: float, qpos: np.ndarray) -> FrameClip:
    """One frame at rest: joints as in `qpos` (nq,), soles as high as standing."""
    model = robot.model
    data, low = mujoco.MjData(model), []
    for posture in (robot.standing_qpos, qpos):
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        low.append(min(float(sole_pose(data, sole)[0][2]) for sole in robot.soles))
    level = qpos.copy()
    level[2] += low[0] - low[1]
    return FrameClip("standing", period, level[None], np.zeros((1, model.nv - 6)))


def read_clip(
    path: str | Path, robot: Robot, joints: Sequence[str], period: float, rate: float = 0.0
) -> FrameClip:
    """A clip of a robot, a frame each `period` [s].

    - ``.npz`` of Isaac Lab's and mjlab's tracking: `joint_pos`, `joint_vel`, `body_pos_w`,
      `body_quat_w` (wxyz) and `fps`. Joints are in the order of `joint_names`, which holosoma
      writes, or of the policy; the root is the body of its name, or the first.
    - ``.csv`` as the retargeted LAFAN1 set: root position, quaternion xyzw and the joints, in the
      robot's order, in each line.
    - ``.npz`` of ``poise motion import`` and ``poise motion script``.

    Between frames positions are interpolated linearly and the root's rotation on the sphere.
    Velocities that the file does not hold are central differences, as both converters take them.

    Args:
        path: of the file.
        robot: whose joints these are.
        joints: of the policy, in its order.
        period: of the policy [s].
        rate: of a .csv [Hz]; 0: 30.

    Raises:
        ConfigError: no such file, another form, sizes that are not the robot's, numbers that are
            not finite, too many frames.
    """
    path = Path(path)
    if path.suffix == ".csv":
        return _clip(path, robot, list(robot.joint_names), period, _csv(path, robot, rate))
    if path.suffix != ".npz":
        raise ConfigError("is no clip of a robot", source=path, choices=("*.npz", "*.csv"))
    archive = read_archive(path)
    if ABOUT in archive.names:
        clip = read_robot_clip(path)
        check_clip_robot(clip, robot, str(path))
        q = clip.qpos
        frames = ClipFrames(1.0 / clip.dt, q[:, :3], q[:, 3:7], q[:, 7:], None)
        return _clip(path, robot, list(robot.joint_names), period, frames)
    lost = [name for name in NPZ if f"{name}.npy" not in archive.names]
    if lost:
        raise ConfigError(f"lacks {', '.join(lost)}: a clip holds {', '.join(NPZ)} and fps",
                          source=path)  # fmt: skip
    named = list(read_names(path, "joint_names") or joints)
    return _clip(path, robot, named, period, _tracking(path, robot, named))


def make_clip(
    name: str, robot: Robot, joints: Sequence[str], period: float, frames: ClipFrames
) -> FrameClip:
    """The same of frames that are given; raises ConfigError naming `name`."""
    return _clip(Path(name), robot, list(joints), period, frames)


def _csv(path: Path, robot: Robot, rate: float) -> ClipFrames:
    lines = [line for line in read_text(path, CSV_BYTES).splitlines() if line.strip()]
    if lines and not _is_row(lines[0]):  # names of the columns
        lines = lines[1:]
    n = len(robot.joint_names)
    with parsing(path):
        rows = np.array([[float(each) for each in line.split(",")] for line in lines[: FRAMES + 1]])
    if rows.ndim != 2 or rows.shape[1] != 7 + n:
        found = rows.shape[1] if rows.ndim == 2 else "other"
        raise ConfigError(f"has {found} columns; {robot.name!r} has {7 + n}: position, quaternion "
                          f"xyzw and {n} joints", source=path)  # fmt: skip
    return ClipFrames(rate or LAFAN_RATE, rows[:, :3], rows[:, [6, 3, 4, 5]], rows[:, 7:], None)


def _is_row(line: str) -> bool:
    try:
        return bool([float(each) for each in line.split(",")])
    except ValueError:
        return False


def _tracking(path: Path, robot: Robot, joints: Sequence[str]) -> ClipFrames:
    arrays = read_arrays(path, (*NPZ, "fps"), kinds="fiu")
    q, v = arrays["joint_pos"], arrays["joint_vel"]
    places, quats = arrays["body_pos_w"], arrays["body_quat_w"]
    n, rate = len(joints), float(arrays["fps"].ravel()[0]) if arrays["fps"].size else 0.0
    if any(len(each) != len(q) for each in (v, places, quats)) or places.ndim != 3 != quats.ndim:
        raise ConfigError("joint_pos, joint_vel, body_pos_w and body_quat_w have other numbers of "
                          "frames", source=path)  # fmt: skip
    if not 1.0 <= rate <= 1000.0:
        raise ConfigError(f"must be from 1 to 1000 Hz, not {rate:g}", source=path, field="fps")
    if q.ndim == 2 and q.shape[1] == 7 + n and v.shape[1] == 6 + n:  # with the root before
        return ClipFrames(rate, q[:, :3], q[:, 3:7], q[:, 7:], v[:, 6:])
    if q.shape[1:] != (n,) or v.shape[1:] != (n,):
        raise ConfigError(f"has {q.shape[-1]} joints, the policy {n}", source=path,
                          field="joint_pos")  # fmt: skip
    bodies = list(read_names(path, "body_names"))
    own = robot.model.body(robot.root_body_id).name
    root = bodies.index(own) if own in bodies else 0
    return ClipFrames(rate, places[:, root], quats[:, root], q, v)


def _clip(
    path: Path, robot: Robot, joints: list[str], period: float, frames: ClipFrames
) -> FrameClip:
    """Frames of the robot's joints, each `period`; those that it leaves out stand."""
    whole = [frames.root, frames.quat, frames.joints]
    whole += [] if frames.velocities is None else [frames.velocities]
    if not 1 <= len(frames.root) <= FRAMES:
        raise ConfigError(f"must have 1 to {FRAMES} frames, not {len(frames.root)}", source=path)
    if not all(np.all(np.abs(each) <= LARGEST) for each in whole):
        raise ConfigError("holds numbers that are not finite, or beyond 10000", source=path)
    norms = np.linalg.norm(frames.quat, axis=1)
    if np.any(np.abs(norms - 1.0) > 0.1):
        raise ConfigError(f"the root's quaternion of frame {int(np.argmax(np.abs(norms - 1.0)))} "
                          "has no norm of 1", source=path)  # fmt: skip
    places = [robot.joint_names.index(name) for name in joints]
    count = len(frames.root)
    ends = (count - 1) / frames.rate
    times = np.arange(int(ends / period + 1e-6) + 1) * period
    at = np.clip(times * frames.rate, 0.0, count - 1.0)
    at = np.where(np.abs(at - np.round(at)) < 1e-6, np.round(at), at)  # a frame is itself
    qpos = np.tile(robot.standing_qpos, (len(times), 1))
    velocities = np.zeros((len(times), len(robot.joint_names)))
    qpos[:, :3] = _between(frames.root, at)
    turns = Rotation.from_quat(frames.quat[:, [1, 2, 3, 0]])
    turned = turns[[0] * len(at)] if count == 1 else Slerp(np.arange(count), turns)(at)
    qpos[:, 3:7] = turned.as_quat()[:, [3, 0, 1, 2]]
    moved = _between(frames.joints, at)
    qpos[:, [7 + i for i in places]] = moved
    if frames.velocities is not None:
        velocities[:, places] = _between(frames.velocities, at)
    elif len(times) > 1:
        velocities[:, places] = np.gradient(moved, period, axis=0)
    return FrameClip(path.stem, period, qpos, velocities)


def _between(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(m, n) rows of values (T, n) at places that may lie between two of them."""
    first = np.floor(at).astype(int)
    second = np.minimum(first + 1, len(values) - 1)
    share = (at - first)[:, None]
    rows: np.ndarray = (1.0 - share) * values[first] + share * values[second]
    return rows
