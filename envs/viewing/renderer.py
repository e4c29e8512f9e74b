"""Pictures of a simulation, off-screen or in MuJoCo's viewer. The simulation is only read."""

import time
from collections.abc import Callable, Mapping

import mujoco
import numpy as np

from poise.envs.physics.simulation import Simulation

from .appearance import looks
from .camera import Camera, find_camera, point
from .offscreen import OffScreen
from .overlays import draw, marks
from .quantities import REFERENCE
from .window import Viewer

MAX_GEOMS = 10_000
XRAY = 0.55  # how strongly an overlay shines through what hides it
LOOK_AT = 0.92  # height above the ground that the camera looks at, over the CoM height
GHOST = 0.4  # opacity of a reference motion
FOLLOW = 0.4  # [s] time constant with which the camera follows


class SceneRenderer:
    """Draws a simulation with its overlays, as `overlays.py` lists them.

    Physics are never touched: positions are copied into a private model and data, so neither
    `render` nor dragging in the viewer changes a bit of the simulation. The camera follows the
    robot with a short delay, so that a push is seen as motion of the robot.

    Args:
        simulation: what to draw.
        human: open MuJoCo's passive viewer, at most in real time, instead of returning frames.
        width: of a frame [pixels].
        height: of a frame [pixels].
        camera: where it stands, or which camera of the model it is, see `find_camera`.
        keys: called with the code of every key that is pressed in the viewer, in its thread.

    Raises:
        ConfigError: there is no such camera.
        PoiseError: there is no OpenGL to draw with, or no display for the viewer.
    """

    def __init__(
        self,
        simulation: Simulation,
        human: bool,
        width: int = 640,
        height: int = 480,
        camera: Camera | Mapping[str, object] | str | int | None = None,
        keys: Callable[[int], object] | None = None,
    ):
        self.simulation = simulation
        self.camera = find_camera(camera, simulation.model)
        own = self.camera if isinstance(self.camera, Camera) else Camera()
        self.model = looks(simulation.robot, width, height, own.azimuth)
        self.data = mujoco.MjData(self.model)
        self._ghost: mujoco.MjData | None = None
        self.shown = np.inf  # simulation time of the last picture [s]
        self.due = 0.0  # wall clock at which the next one is shown [s]
        self.scene = mujoco.MjvScene(self.model, MAX_GEOMS)
        self.screen = None if human else OffScreen(self.model, width, height)
        self.viewer = Viewer(self.model, self.data, keys) if human else None
        self.view = self.viewer.handle.cam if self.viewer else mujoco.MjvCamera()
        point(self.view, self.camera, simulation.robot.height_com)

    @property
    def is_open(self) -> bool:
        """False after `close`, and when the user has closed the viewer's window."""
        watched = self.viewer is not None and self.viewer.handle.is_running()
        return self.screen is not None or watched

    def render(self, ghost: np.ndarray | None = None) -> np.ndarray | None:
        """A frame (height, width, 3) uint8; None where a viewer shows it, or when not open.

        A frame has the robot once more, yellow and translucent, in a posture `ghost` (nq,).
        """
        if self.screen is not None:
            self._update()
            return self._frame(self.screen, ghost)
        if self.viewer is not None and self.viewer.handle.is_running():
            self._wait()
            handle = self.viewer.handle
            with handle.lock():
                self._update()
                handle.user_scn.ngeom = 0
                draw(handle.user_scn, marks(self.simulation))
            handle.sync()
        return None

    def close(self) -> None:
        """Close the viewer or free the off-screen buffer; safe to call twice."""
        for held in (self.screen, self.viewer):
            if held is not None:
                held.close()
        self.screen = self.viewer = None

    def _update(self) -> None:
        """Bring positions, lamp and camera up to date."""
        self.data.qpos[:] = self.simulation.data.qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        state, size = self.simulation.state, self.simulation.robot.height_com
        height = float(state.ground.mean()) + LOOK_AT * size
        target = np.array([*state.com[:2], height])
        elapsed = self.simulation.time - self.shown
        self.shown = self.simulation.time
        if elapsed < 0.0 or self.shown == 0.0:  # another episode
            self.view.lookat = target
        else:
            fraction = 1.0 - np.exp(-elapsed / FOLLOW)
            self.view.lookat = self.view.lookat + fraction * (target - self.view.lookat)

    def _frame(self, screen: OffScreen, ghost: np.ndarray | None) -> np.ndarray:
        """The scene, with the marks that it hides shining through."""
        found, scene = marks(self.simulation), self.scene
        mujoco.mjv_updateScene(
            self.model, self.data, mujoco.MjvOption(), None, self.view,
            mujoco.mjtCatBit.mjCAT_ALL, scene,
        )  # fmt: skip
        if ghost is not None:
            self._add_ghost(ghost)
        draw(scene, found)
        frame = screen.draw(scene)
        scene.ngeom = 0
        draw(scene, [mark for mark in found if mark.opacity == 1.0])
        scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 0
        alone = screen.draw(scene)
        scene.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = 1
        covered = alone.max(axis=2) > 0
        frame[covered] = (1.0 - XRAY) * frame[covered] + XRAY * alone[covered]
        return frame

    def _add_ghost(self, posture: np.ndarray) -> None:
        """Append the robot in a posture to the scene, in the colour of references."""
        if self._ghost is None:
            self._ghost = mujoco.MjData(self.model)
        self._ghost.qpos[:] = posture
        mujoco.mj_kinematics(self.model, self._ghost)
        first = self.scene.ngeom
        mujoco.mjv_addGeoms(
            self.model, self._ghost, mujoco.MjvOption(), mujoco.MjvPerturb(),
            mujoco.mjtCatBit.mjCAT_DYNAMIC, self.scene,
        )  # fmt: skip
        for geom in self.scene.geoms[first : self.scene.ngeom]:
            geom.matid = -1
            geom.rgba[:] = (*REFERENCE.colour, GHOST)

    def _wait(self) -> None:
        """Sleep until the wall clock has caught up with the simulation."""
        now = time.monotonic()
        self.due += self.simulation.time - self.shown
        if self.simulation.time <= self.shown or self.due < now:  # new episode, or late
            self.due = now
        time.sleep(self.due - now)
