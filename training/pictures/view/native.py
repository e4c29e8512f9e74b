"""MuJoCo's own window: one controller, pushed by keys and by the mouse."""

import queue
import time

import mujoco
import numpy as np

from poise.configs.errors import PoiseError
from poise.envs.viewing.renderer import SceneRenderer
from poise.envs.viewing.window import Viewer
from poise.training.pictures.sessions.live import Live
from poise.training.pictures.sessions.mouse import DURATION, WEIGHT, Pull, grabbed_point
from poise.training.pictures.sessions.pace import RealTimePace

from .server import until_ctrl_c

HELP = (
    "space: pause; right arrow: one step; backspace: reset; 8, 4, 5, 6: push forward, left, "
    "backward, right; or double-click on a body, then drag with Ctrl and the right button"
)
SPACE, RIGHT, BACKSPACE = 32, 262, 259  # GLFW's codes
DIRECTIONS = {ord("8"): 0.0, ord("4"): 90.0, ord("5"): 180.0, ord("6"): -90.0}  # key → push [deg]
WAIT = 0.02  # [s] between two pictures while it is paused


class NativeView:
    """Plays a session of one controller in MuJoCo's window until that is closed."""

    def __init__(self, live: Live):
        self.live, self.paused, self.pace = live, False, RealTimePace()
        self._keys = queue.SimpleQueue[int]()  # pressed, in the window's thread
        simulation = live.session.sides[0].env.simulation
        self.renderer = SceneRenderer(simulation, human=True, keys=self._keys.put)
        self._pull: Pull | None = None

    def run(self, seconds: float | None = None) -> None:
        """Play, for some seconds of the wall clock or until the window is closed."""
        end = time.monotonic() + (float("inf") if seconds is None else seconds)
        self.pace = RealTimePace()
        while self.renderer.is_open and time.monotonic() < end:
            while not self._keys.empty():
                self.press(self._keys.get())
            self.advance()
            self.renderer.render()
            time.sleep(WAIT if self.paused else self.pace.until_due(self.live.period))

    def advance(self) -> None:
        """Play the steps that are due, and push what the mouse has let go of."""
        self._follow_mouse()
        if self.paused:
            self.pace.rest()
            return
        for _ in range(self.pace.due(self.live.period)):
            self.live.step()

    def press(self, key: int) -> None:
        """Do what a key asks for; others mean nothing."""
        if key == SPACE:
            self.paused = not self.paused
        elif key == RIGHT:
            self.paused = True
            self.live.step()
        elif key == BACKSPACE:
            self.live.reset()
        elif (direction := DIRECTIONS.get(key)) is not None:
            impulse = WEIGHT * self.live.robot.mass
            self._push({"impulse": impulse, "direction": direction, "duration": DURATION})

    def _follow_mouse(self) -> None:
        viewer = self.renderer.viewer
        found = None if viewer is None else self._pulled(viewer)
        if found is None and self._pull is not None:
            self._push(self._pull.fields(self.live.robot, self.live.yaw, DURATION))
        self._pull = found

    def _push(self, fields: dict[str, object]) -> None:
        """Push the robot; print the error of an invalid push, and keep the window open."""
        try:
            self.live.push(**fields)
        except PoiseError as error:
            print(error)

    def _pulled(self, viewer: Viewer) -> Pull | None:
        """Return the body that MuJoCo's window drags, if it is one of the robot's."""
        perturb, data = viewer.handle.perturb, self.live.session.sides[0].env.data
        body = int(perturb.select)
        if not perturb.active & int(mujoco.mjtPertBit.mjPERT_TRANSLATE) or body < 1:
            return None
        rotation = data.xmat[body].reshape(3, 3)
        start = data.xpos[body] + rotation @ perturb.localpos
        arrow = (np.array(perturb.refselpos) - start) * [1.0, 1.0, 0.0]
        point = grabbed_point(self.live.robot, body, data.xpos[body], rotation, start)
        return Pull(body, point, start, arrow)


def run_native(live: Live, seconds: float | None) -> float:
    """Show a session of one controller; returns the real-time factor reached.

    Raises PoiseError without a display.
    """
    view = NativeView(live)
    print(HELP)
    try:
        with until_ctrl_c():
            view.run(seconds)
    finally:
        view.renderer.close()
    print(f"{view.pace.total:.3f} × real time over {view.pace.wanted:.1f} s")
    return view.pace.total
