"""Pushing with the mouse: a body is dragged, and the arrow that this draws is the push."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.robots.robot import Robot
from poise.envs.viewing.overlays import ARROW, Mark
from poise.envs.viewing.quantities import PUSH

from .frames import Frame

DURATION = 0.1  # of a push, by default [s]
WEIGHT = 0.5  # of a push, by default: J/m [m/s]
GAIN = 1.0  # [m/s] of J/m for an arrow as long as the CoM is high
LONGEST = 2.0  # arrow over CoM height
FLAT = 0.1  # a ray that goes down less steeply than this does not point at a place


class Pull(NamedTuple):
    """A body that is being dragged.

    Attributes:
        body: its id.
        point: (3,) where it was grabbed, from the body's centre of mass, body axes [m].
        start: (3,) the same place now [m], world axes.
        arrow: (3,) from there to the mouse [m], horizontal.
    """

    body: int
    point: np.ndarray
    start: np.ndarray
    arrow: np.ndarray

    def mark(self, robot: Robot) -> Mark:
        """Return the arrow that begins where the body was grabbed."""
        return Mark("push", ARROW, self.start, self.start + self.arrow, 0.03 * robot.height_com,
                    PUSH.colour, 0.8)  # fmt: skip

    def fields(self, robot: Robot, yaw: float, duration: float) -> dict[str, object]:
        """The push, as `parse_pushes` takes it; `yaw` [rad] is that of the heading at the reset."""
        x, y = self.arrow[:2]
        length = float(np.hypot(x, y)) / robot.height_com
        direction = np.degrees(np.arctan2(y, x) - yaw)
        return {
            "impulse": round(GAIN * robot.mass * length, 2),
            "direction": round(float((direction + 180.0) % 360.0 - 180.0), 1),
            "duration": duration,
            "body": robot.model.body(self.body).name,
            "point": [round(float(part), 4) for part in self.point],
        }


def pull(
    robot: Robot, frame: Frame, body: int, grabbed: np.ndarray, ray: tuple[np.ndarray, np.ndarray]
) -> Pull:
    """Return the pull of a body that was grabbed at a point (3,), world axes, towards the mouse.

    `ray` is where the camera is (3,) and a point (3,) under the mouse, at any distance. The arrow
    ends where the ray meets the horizontal plane through the grabbed point.
    """
    rotation = Rotation.from_quat(frame.quaternions[body], scalar_first=True).as_matrix()
    point = grabbed_point(robot, body, frame.positions[body], rotation, grabbed)
    arrow = _to_plane(*ray, grabbed[2]) - grabbed
    arrow[2] = 0.0
    longest, length = LONGEST * robot.height_com, float(np.linalg.norm(arrow))
    if length > longest:
        arrow *= longest / length
    return Pull(body, point, grabbed, arrow)


def grabbed_point(
    robot: Robot, body: int, position: np.ndarray, rotation: np.ndarray, grabbed: np.ndarray
) -> np.ndarray:
    """Return a place (3,), world axes, from a body's centre of mass and in the body's axes [m].

    `position` (3,) and `rotation` (3, 3) are the body's.
    """
    return rotation.T @ (grabbed - position) - robot.model.body_ipos[body]


def _to_plane(eye: np.ndarray, through: np.ndarray, height: float) -> np.ndarray:
    """The point (3,) at `height` [m] on the ray; `through` itself where the ray is too flat."""
    ray = through - eye
    ray = ray / max(float(np.linalg.norm(ray)), 1e-9)
    distance = (height - eye[2]) / ray[2] if abs(ray[2]) > FLAT else -1.0
    return eye + distance * ray if distance > 0.0 else np.array(through, dtype=float)
