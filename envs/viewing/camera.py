"""The camera: Poise's own, which follows the robot, or one of the robot's model."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build, to_dict

SIDE = 65.0  # [deg] that `beside` stands off a push's line: 90 would never see a face


@dataclass(frozen=True)
class Camera:
    """The place of the camera, seen from the robot in its standing posture."""

    azimuth: float = field(default=50.0)  # [deg] counter-clockwise: 0 = in front, 90 = left
    elevation: float = field(default=22.0, metadata={"min": 0.0, "max": 90.0})  # [deg] above it
    distance: float = field(default=4.7, metadata={"above": 0.0})  # over the CoM height


def find_camera(camera: object, model: mujoco.MjModel) -> Camera | int:
    """A `Camera`, or the id of one of the model's.

    Args:
        camera: None for Poise's own as it is by default, a `Camera` or a mapping of its fields for
            it elsewhere, a name or an id for a camera of the model.
        model: of the robot.

    Raises:
        ConfigError: the model has no such camera, or a field of a `Camera` is not valid.
    """
    if camera is None:
        return Camera()
    if isinstance(camera, (Camera, Mapping)):
        return build(Camera, to_dict(camera), "camera")
    names = [model.camera(i).name or i for i in range(model.ncam)]
    if isinstance(camera, str) and camera in names:
        return names.index(camera)
    if isinstance(camera, (int, np.integer)) and not isinstance(camera, bool):
        if 0 <= camera < model.ncam:
            return int(camera)
    raise ConfigError(f"the robot's model has no camera {shown(camera)}", field="camera",
                      choices=[None, *names])  # fmt: skip


def point(view: mujoco.MjvCamera, camera: Camera | int, size: float) -> None:
    """Make `view` the camera's; `size` [m] is the robot's CoM height."""
    if isinstance(camera, int):
        view.type, view.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera
        return
    view.azimuth = camera.azimuth + 180.0
    view.elevation = -camera.elevation
    view.distance = camera.distance * size


def beside(direction: float, camera: Camera | None = None) -> Camera:
    """A camera that sees a push of `direction` [deg] from its side, the robot's front if it can.

    Its azimuth is `SIDE` off the push's line, on the one of four such places nearest to `camera`'s.
    """
    camera = camera or Camera()
    places = [direction + turn for turn in (SIDE, 180.0 - SIDE, 180.0 + SIDE, -SIDE)]
    azimuth = min(places, key=lambda place: abs(_turned(place - camera.azimuth)))
    return replace(camera, azimuth=_turned(azimuth))


def _turned(angle: float) -> float:
    """The same angle within [-180, 180)."""
    return (angle + 180.0) % 360.0 - 180.0
