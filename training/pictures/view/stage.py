"""The scene: ground, robots side by side, their names and marks; the camera goes with them."""

import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import trimesh
import viser

from poise.envs.robots.robot import Robot
from poise.envs.terrain.building import SHADES, THICKNESS, box_below
from poise.envs.terrain.terrain import Surface
from poise.envs.viewing.camera import Camera
from poise.envs.viewing.overlays import Mark
from poise.envs.viewing.quantities import REFERENCE
from poise.training.pictures.sessions.frames import Frame, ground_at
from poise.training.pictures.sessions.mouse import Pull, pull

from .marks import SceneMarks
from .robots import Robots

ROOT = "/world"  # of the scene, moved against the robot
LANE = 1.7  # distance of robots side by side, over CoM height
GHOST = 0.35  # opacity of a reference motion
FOLLOW = 0.4  # [s] time constant with which the scene follows the robot
CAMERA = Camera(azimuth=35.0, elevation=14.0)
ALONE, TALL = 1.5, 2.4  # width and height that are seen of one robot, over CoM height
PHONE = 576  # width [pixels] below which viser has the controls below
LOOK_AT = 1.0  # height that the camera looks at, over CoM height
FIELD_OF_VIEW = 32.0  # [deg], vertical
NAME_AT = 2.05  # height of a robot's name above the ground, over CoM height
SKY, SUN = 1.5, 1.9  # brightness: together, what faces up has its own colour
LIGHT, DARK = (206, 209, 212), (90, 94, 100)  # lines on the ground
BACKGROUND = {False: (255, 255, 255), True: (20, 21, 23)}  # dark → colour
GROUND = {False: (232, 234, 236), True: (62, 66, 72)}  # dark → colour
Triangles = tuple[np.ndarray, np.ndarray]
Grabbed = Callable[[str, Pull], None]  # phase of the drag, what it is now


class ViewStage:
    """What is seen of robots of one kind, one for each name.

    Args:
        server: whose scene it is.
        robot: their kind.
        names: above them.
        grabbed: called while a body is dragged with the mouse, in the server's thread.
        opacity: of the robots.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        names: Sequence[str],
        grabbed: Grabbed,
        opacity: float = 1.0,
    ):
        self._server, self.robot, self._grabbed = server, robot, grabbed
        size, count = robot.height_com, len(names)
        middle = 0.5 * (count - 1)
        # the first stands to the left, as in a video: the camera looks at them from in front
        self._offsets = np.array([[0.0, LANE * size * (k - middle), 0.0] for k in range(count)])
        scene = server.scene
        self._root = scene.add_frame(ROOT, show_axes=False)
        self.robots = Robots(scene, ROOT, robot, count, opacity)
        self.ghosts: Robots | None = None  #: of the reference motion, where there is one
        self.marks = SceneMarks(scene, ROOT, count)
        self._ground: list[np.ndarray] = []  # surfaces that are drawn
        self.boxes: list[viser.MeshHandle] = []  #: of the ground
        self._names = [
            scene.add_label(f"{ROOT}/names/{k}", name, anchor="bottom-center")
            for k, name in enumerate(names)
        ]
        self.pull: Pull | None = None  #: that is drawn
        self.following = True
        self._middle, self._time = np.zeros(3), np.inf
        self.floor = 0.0  #: height at which the page's floor is seen [m]
        self.frames: Sequence[Frame] = ()  #: that are shown
        for mesh in self.robots.meshes:
            mesh.handle.on_drag("left")(self._dragged(mesh.body))
        server.initial_camera.fov = np.radians(FIELD_OF_VIEW)

    def show(self, frames: Sequence[Frame]) -> None:
        """Show the robots and their marks, one frame for each."""
        self.frames = frames
        self._follow(frames)
        self.floor = min(frame.floor for frame in frames) - float(self._middle[2])
        found: list[tuple[Mark, np.ndarray]] = [
            (mark, offset)
            for frame, offset in zip(frames, self._offsets, strict=True)
            for mark in frame.marks
        ]
        if self.pull is not None:
            found.append((self.pull.mark(self.robot), np.zeros(3)))
        with self._server.atomic():
            self._root.position = -self._middle
            self._show_ground(frames)
            self.robots.show(frames, self._offsets)
            self._show_ghosts(frames)
            self.marks.show(found)
            for label, frame, offset in zip(self._names, frames, self._offsets, strict=True):
                up = np.array([0.0, 0.0, NAME_AT * self.robot.height_com])
                label.position = _below(frame) + up + offset

    def _show_ground(self, frames: Sequence[Frame]) -> None:
        """Rebuild the ground of each robot where it changed; a lane is as wide as its ground."""
        ground = [frame.surfaces for frame in frames]
        if len(ground) == len(self._ground) and all(map(operator.is_, ground, self._ground)):
            return
        for box in self.boxes:
            box.remove()
        self._ground = ground
        half = 0.5 * LANE * self.robot.height_com if len(frames) > 1 else np.inf
        self.boxes = [
            self._server.scene.add_mesh_simple(
                f"{ROOT}/ground/{k}_{shade}", *mesh, flat_shading=True,
                color=SHADES[shade][:3], position=offset,
            )
            for k, (frame, offset) in enumerate(zip(frames, self._offsets, strict=True))
            for shade, mesh in ground_meshes(frame.surfaces, frame.floor, half).items()
        ]  # fmt: skip

    def _show_ghosts(self, frames: Sequence[Frame]) -> None:
        """Show where the bodies are to be, in frames that say it."""
        poses = [frame.ghost for frame in frames if frame.ghost is not None]
        if len(poses) < len(frames):
            return
        if self.ghosts is None:
            scene, count = self._server.scene, len(frames)
            self.ghosts = Robots(
                scene, f"{ROOT}/ghosts", self.robot, count, GHOST, REFERENCE.colour
            )
        self.ghosts.set_visible(REFERENCE not in self.marks.hidden)
        self.ghosts.show(poses, self._offsets)

    def point_camera(self, client: viser.ClientHandle, phone: bool) -> np.ndarray:
        """Let a page see all robots, whatever its form; returns where its camera is (3,) [m]."""
        seen, size = client.camera, self.robot.height_com
        eye, target = first_view(size, len(self._names), seen.aspect, phone)
        with client.atomic():
            seen.fov = np.radians(FIELD_OF_VIEW)
            seen.position, seen.look_at = eye, target
        return eye

    def remove(self) -> None:
        """Take everything out of the scene."""
        self._root.remove()

    def _follow(self, frames: Sequence[Frame]) -> None:
        """Let the middle of the robots' ground pull the scene's origin with a short delay."""
        target = np.mean([_below(frame) for frame in frames], axis=0)
        elapsed, self._time = frames[0].time - self._time, frames[0].time
        if not self.following:
            return
        fraction = 1.0 if elapsed < 0.0 else 1.0 - np.exp(-elapsed / FOLLOW)
        self._middle = self._middle + fraction * (target - self._middle)

    def _dragged(self, body: int) -> Callable[[Any], Any]:
        async def callback(event: Any) -> None:  # a coroutine: viser keeps these in order
            side = event.instance_index or 0
            if side >= len(self.frames):
                return
            shift = self._offsets[side] - self._middle
            eye = np.asarray(event.client.camera.position) - shift
            grabbed = np.asarray(event.start_position) - shift
            ray = eye, np.asarray(event.end_position) - shift
            found = pull(self.robot, self.frames[side], body, grabbed, ray)
            shown = found._replace(start=found.start + self._offsets[side])
            self._grabbed(event.phase, shown)

        return callback


def _below(frame: Frame) -> np.ndarray:
    """Return (3,) the ground below the centre of mass [m]."""
    return ground_at(frame.com, frame.surfaces, frame.floor)


def ground_meshes(surfaces: np.ndarray, floor: float, half: float) -> dict[int, Triangles]:
    """Boxes between the surfaces (n,) and the floor [m]: it lets through what is below it.

    Args:
        surfaces: as of `Surface`.
        floor: height of the plane below them.
        half: width to either side of the way beyond which nothing is drawn.

    Returns:
        vertices (n, 3) and faces (m, 3) by their number among `SHADES`.
    """
    boxes: dict[int, list[trimesh.Trimesh]] = {}
    for i, row in enumerate(surfaces.tolist()):
        surface = Surface(*row)
        surface = surface._replace(y_min=max(surface.y_min, -half), y_max=min(surface.y_max, half))
        is_floor = surface.gradient == 0.0 and surface.height == floor
        if is_floor or surface.y_min >= surface.y_max:
            continue
        size, middle, quaternion = box_below(surface, floor + THICKNESS)
        turned = trimesh.transformations.quaternion_matrix(quaternion)
        turned[:3, 3] = middle
        box = trimesh.creation.box(2.0 * size, turned)
        boxes.setdefault(i % len(SHADES), []).append(box)
    return {
        shade: trimesh.util.append_faces([b.vertices for b in some], [b.faces for b in some])
        for shade, some in boxes.items()
    }


def set_look(server: viser.ViserServer, dark: bool) -> viser.GridHandle:
    """Light and theme of the page, and its floor, which is returned."""
    server.gui.configure_theme(dark_mode=dark, show_logo=False, show_share_button=False)
    server.scene.configure_default_lights(False)  # they bleach the colours that tell marks apart
    server.scene.add_light_hemisphere("/light/sky", ground_color=(200, 200, 200), intensity=SKY)
    server.scene.add_light_directional(
        "/light/sun", intensity=SUN, cast_shadow=True, position=(2.5, 1.0, 5.0)
    )
    return server.scene.add_grid(
        "/ground", infinite_grid=True, cell_size=0.5, section_size=1.0, fade_distance=30.0,
        cell_color=DARK if dark else LIGHT, section_color=DARK if dark else LIGHT,
        plane_color=GROUND[dark], plane_opacity=0.6, shadow_opacity=0.25,
    )  # fmt: skip


def first_view(
    size: float, count: int, aspect: float, phone: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Where the camera is (3,), and what it looks at (3,) [m].

    Several robots are seen more from in front. On a phone they stand above the controls.

    Args:
        size: height of the CoM [m].
        count: of robots.
        aspect: width over height of the page.
        phone: whether the controls cover the lower part of it.
    """
    a = np.radians(CAMERA.azimuth if count == 1 else 0.6 * CAMERA.azimuth)
    e = np.radians(CAMERA.elevation)
    away = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    width = (LANE * (count - 1) + ALONE) * size
    height = max(TALL * size * (2.6 if phone else 1.0), width / aspect)  # that is seen [m]
    look_at = np.array([0.0, 0.0, LOOK_AT * size - (0.3 * height if phone else 0.0)])
    distance = 0.5 * height / np.tan(0.5 * np.radians(FIELD_OF_VIEW))
    return look_at + distance * away, look_at
