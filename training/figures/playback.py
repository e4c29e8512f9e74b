"""A motion without physics, as a video: the robot, and the skeleton of the file beside it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.colors import to_rgb

from poise.baselines.clips.clip import Clip
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from poise.envs.viewing.appearance import looks
from poise.envs.viewing.camera import Camera, point
from poise.envs.viewing.offscreen import OffScreen
from poise.envs.viewing.overlays import BAR, SPHERE, Mark, draw
from poise.envs.viewing.renderer import LOOK_AT

from .encoder import FORMS, Encoder
from .style import ORANGE

RATE = 25.0  # [1/s] of the frames
BESIDE = 1.0  # to the robot's left, over the CoM height
BONE, HEAD = 0.022, 0.03  # radii over the CoM height
MOST_GEOMS = 2_000


class Skeletons:
    """A clip's bones as marks, as large as the robot, with the lowest joint on the ground.

    Args:
        clip: whose frames.
        scale: the robot's size over the clip's.
        begins: time of the playback at which the clip begins [s]; its ends are held.
        place: (3,) where its root stands over the ground at its begin [m].
        size: the robot's CoM height [m].
    """

    def __init__(self, clip: Clip, scale: float, begins: float, place: np.ndarray, size: float):
        self.clip, self.begins, self.size = clip, begins, size
        places = scale * clip.places()
        places -= places[0, 0] * [1.0, 1.0, 0.0] + [0.0, 0.0, float(places[..., 2].min())]
        self.places = places + place

    def marks(self, time: float) -> list[Mark]:
        """The bones at a time of the playback [s]."""
        frame = int(np.clip(round((time - self.begins) / self.clip.dt), 0, len(self.clip) - 1))
        joints, colour = self.places[frame], to_rgb(ORANGE)
        found = [
            Mark("bone", BAR, joints[parent], joints[i], BONE * self.size, colour)
            for i, parent in enumerate(self.clip.skeleton.parents)
            if parent >= 0 and np.linalg.norm(joints[parent] - joints[i]) > 1e-3
        ]
        ends = [Mark("joint", SPHERE, p, p, HEAD * self.size, colour) for p in joints]
        return found + ends


def playback_frames(
    robot: Robot, qpos: np.ndarray, dt: float, skeleton: Skeletons | None, size: tuple[int, int]
) -> Iterator[np.ndarray]:
    """Frames (height, width, 3) uint8, 25 a second, of postures (F, nq) `dt` [s] apart.

    Raises PoiseError if nothing can be drawn here.
    """
    camera = Camera(azimuth=25.0, distance=4.7 if skeleton is None else 5.6)
    model = looks(robot, *size, camera.azimuth)
    data, scene = mujoco.MjData(model), mujoco.MjvScene(model, MOST_GEOMS)
    view, screen = mujoco.MjvCamera(), OffScreen(model, *size)
    point(view, camera, robot.height_com)
    aside = 0.5 * BESIDE * robot.height_com if skeleton is not None else 0.0
    view.lookat = np.append(qpos[0, :2] + [0.0, aside], LOOK_AT * robot.height_com)
    try:
        for time in np.arange(0.0, (len(qpos) - 1) * dt + 1e-9, 1.0 / RATE):
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


def check_video(path: Path) -> None:
    """Raise ConfigError for a path that is no video's."""
    if path.suffix.lower() not in FORMS:
        raise ConfigError(f"the name of a video must end in {' or '.join(FORMS)}", source=path)


def write_playback(
    path: Path, robot: Robot, qpos: np.ndarray, dt: float, skeleton: Skeletons | None = None,
    size: tuple[int, int] = (640, 480),
) -> int:  # fmt: skip
    """Write the video and return its number of frames; the file appears whole or not at all.

    Raises PoiseError if nothing can be drawn or encoded here, or the file cannot be written.
    """
    count = 0
    with Encoder(path, size, RATE) as video:
        for frame in playback_frames(robot, qpos, dt, skeleton, size):
            video.send(frame)
            count += 1
    return count


def beside_of(robot: Robot, clip: Clip, scale: float, begins: float) -> Skeletons:
    """The skeleton of a clip to the left of a robot that stands."""
    size = robot.height_com
    place = np.append(robot.standing_qpos[:2] + [0.0, BESIDE * size], 0.0)
    turned = clip.turned(-float(clip.facing()[0]))
    return Skeletons(turned, scale, begins, place, size)
