"""A motion without physics, as a video: the robot, and the skeleton of the file beside it."""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.colors import to_rgb
from scipy.ndimage import gaussian_filter1d

from poise.baselines.motion.clips.clip import Clip
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from poise.envs.viewing.appearance import looks
from poise.envs.viewing.camera import Camera, point
from poise.envs.viewing.offscreen import OffScreen
from poise.envs.viewing.overlays import BAR, SPHERE, Mark, draw
from poise.envs.viewing.renderer import LOOK_AT

from .encoder import encoded
from .palette import ORANGE

RATE = 25.0  # [1/s] of the frames
PADDING = 1.0  # to the robot's left, over the CoM height
BONE, HEAD = 0.022, 0.03  # radii over the CoM height
MOST_GEOMS = 2_000
STILL = 0.3  # [m] by which what is looked at may move before the camera follows


class SkeletonMarks:
    """A clip's bones as marks, as large as the robot, on the ground to the left of where it stands.

    Args:
        robot: that stands.
        clip: whose frames.
        scale: the robot's size over the clip's.
        begins: time of the playback at which the clip begins [s]; its ends are held.
        heading: where the robot has ahead in the clip [rad]; None: where it faces at its begin.
        stride: share of its way over the ground that it goes, so that it stays beside a robot whose
            steps are shorter.
    """

    def __init__(
        self, robot: Robot, clip: Clip, scale: float, begins: float, heading: float | None = None,
        stride: float = 1.0,
    ):  # fmt: skip
        self.begins, self.size = begins, robot.height_com
        self.clip = clip.turned(-(float(clip.facing()[0]) if heading is None else heading))
        place = np.append(robot.standing_qpos[:2] + [0.0, PADDING * self.size], 0.0)
        places = scale * self.clip.places()
        places -= places[0, 0] * [1.0, 1.0, 0.0] + [0.0, 0.0, float(places[..., 2].min())]
        way = (places[:, :1] - places[0, 0]) * [1.0, 1.0, 0.0]
        self.places = places + place - (1.0 - stride) * way

    def root(self, time: float) -> np.ndarray:
        """Return (2,) where it is over the ground at a time of the playback [s]."""
        return np.asarray(self.places[self._frame(time), 0, :2])

    def _frame(self, time: float) -> int:
        return int(np.clip(round((time - self.begins) / self.clip.dt), 0, len(self.clip) - 1))

    def marks(self, time: float) -> list[Mark]:
        """Return the bones at a time of the playback [s]."""
        joints, colour = self.places[self._frame(time)], to_rgb(ORANGE)
        found = [
            Mark("bone", BAR, joints[parent], joints[i], BONE * self.size, colour)
            for i, parent in enumerate(self.clip.skeleton.parents)
            if parent >= 0 and np.linalg.norm(joints[parent] - joints[i]) > 1e-3
        ]
        ends = [Mark("joint", SPHERE, p, p, HEAD * self.size, colour) for p in joints]
        return found + ends


def playback_frames(
    robot: Robot, qpos: np.ndarray, dt: float, skeleton: SkeletonMarks | None, size: tuple[int, int]
) -> Iterator[np.ndarray]:
    """Yield frames (height, width, 3) uint8, 25 a second, of postures (F, nq) `dt` [s] apart.

    Raises PoiseError if nothing can be drawn here.
    """
    camera = Camera(azimuth=25.0, distance=4.7 if skeleton is None else 5.6)
    model = looks(robot, *size, camera.azimuth)
    data, scene = mujoco.MjData(model), mujoco.MjvScene(model, MOST_GEOMS)
    view, screen = mujoco.MjvCamera(), OffScreen(model, *size)
    point(view, camera, robot.height_com)
    times = np.arange(0.0, (len(qpos) - 1) * dt + 1e-9, 1.0 / RATE)
    seen = looked_at(qpos[:, :2], dt, times, skeleton)
    try:
        for time, middle in zip(times, seen, strict=True):
            view.lookat = np.append(middle, LOOK_AT * robot.height_com)
            data.qpos[:] = qpos[min(round(time / dt), len(qpos) - 1)]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, view,
                                   mujoco.mjtCatBit.mjCAT_ALL, scene)  # fmt: skip
            draw(scene, [] if skeleton is None else skeleton.marks(float(time)))
            yield screen.draw(scene)
    finally:
        screen.close()


def looked_at(
    root: np.ndarray, dt: float, times: np.ndarray, skeleton: SkeletonMarks | None
) -> np.ndarray:
    """(n, 2) between robot and skeleton, smoothed over a second; still where they hardly move."""
    middle = root[np.minimum(np.round(times / dt).astype(int), len(root) - 1)]
    if skeleton is not None:
        middle = 0.5 * (middle + np.array([skeleton.root(float(time)) for time in times]))
    if np.ptp(middle, axis=0).max() < STILL:
        return np.repeat(middle[:1], len(times), axis=0)
    return np.asarray(gaussian_filter1d(middle, 0.5 * RATE, axis=0, mode="nearest"))


def check_size(size: tuple[int, int]) -> None:
    """Raise ConfigError for a size that no video has."""
    if any(edge < 16 or edge > 4096 or edge % 2 for edge in size):
        raise ConfigError(f"must be two even numbers from 16 to 4096, not {size}", field="size")


def write_playback(
    path: Path, robot: Robot, qpos: np.ndarray, dt: float, skeleton: SkeletonMarks | None = None,
    size: tuple[int, int] = (640, 480),
) -> int:  # fmt: skip
    """Write the video and return its number of frames; the file appears whole or not at all.

    Raises PoiseError if nothing can be drawn or encoded here, or the file cannot be written.
    """
    count = 0
    with encoded(path, size, RATE) as send:
        for frame in playback_frames(robot, qpos, dt, skeleton, size):
            send(frame)
            count += 1
    return count
