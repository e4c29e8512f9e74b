"""MuJoCo's passive viewer: a window that shows what it is given, and closes without a crash."""

import atexit
import threading
import warnings
from collections.abc import Callable

import mujoco

from poise.configs.errors import PoiseError


class Viewer:
    """A window on `model` and `data`; draw through `handle`, MuJoCo's own.

    `keys` is called with the code of every key that is pressed, in the viewer's thread.

    Raises:
        PoiseError: there is no display, or MuJoCo cannot use it.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        keys: Callable[[int], object] | None = None,
    ):
        running = set(threading.enumerate())
        try:
            import glfw
            import mujoco.viewer

            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # GLFW's reasons; the error says enough
                if not glfw.init():  # the viewer's own thread would wait for ever
                    raise PoiseError("GLFW finds no display")
            self.handle = mujoco.viewer.launch_passive(
                model, data, key_callback=keys, show_left_ui=False, show_right_ui=False
            )
        except (PoiseError, ImportError, RuntimeError) as error:
            raise PoiseError(
                f"the viewer cannot open ({error}): it needs a display, and mjpython on macOS; "
                'render_mode="rgb_array" draws without one'
            ) from error
        self.threads = set(threading.enumerate()) - running
        # or the robot would hide what is drawn inside and below it
        self.handle.opt.flags[mujoco.mjtVisFlag.mjVIS_TRANSPARENT] = 1
        atexit.register(self.close)

    def close(self) -> None:
        """Close the window and wait for its thread: Python's exit crashes while it runs."""
        atexit.unregister(self.close)
        self.handle.close()
        for thread in self.threads:
            thread.join(timeout=5.0)
