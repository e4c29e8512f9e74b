"""An off-screen OpenGL buffer. Several may live side by side, and close in any order."""

import os
import warnings
from typing import ClassVar

import mujoco
import numpy as np

from poise.configs.errors import PoiseError


class OffScreen:
    """Draws scenes of `model` as arrays.

    MuJoCo's own `Renderer` frees its OpenGL objects in whatever context is current, which breaks
    the pictures of another one; here the right context is made current first.

    MuJoCo is asked once to load an OpenGL that there is not: a second time, the lock of what it had
    begun to load is still held, and the process is aborted.

    Raises:
        PoiseError: MuJoCo finds no OpenGL. The text says what to install and to set.
    """

    _missing: ClassVar[str | None] = None  #: what MuJoCo said of an OpenGL that it did not find

    def __init__(self, model: mujoco.MjModel, width: int, height: int):
        self.rectangle = mujoco.MjrRect(0, 0, width, height)
        self.gl = self.context = None
        if self._missing is not None:
            raise PoiseError(self._missing)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of GLFW: the error says enough
            try:
                self.gl = mujoco.GLContext(width, height)
                self.gl.make_current()
                self.context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            except Exception as error:  # every GL back end fails in its own way
                reason = (str(error).splitlines() or [type(error).__name__])[0]
                text = (
                    "MuJoCo cannot draw off-screen: install libosmesa6 (Debian, Ubuntu) and set "
                    "MUJOCO_GL=osmesa before Python starts, or MUJOCO_GL=egl where there is a GPU "
                    f"(MUJOCO_GL is now {os.environ.get('MUJOCO_GL') or 'not set'}; {reason})"
                )
                OffScreen._missing = None if self.gl is None else text
                self.gl = None
                raise PoiseError(text) from error
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self.context)

    def draw(self, scene: mujoco.MjvScene) -> np.ndarray:
        """A frame (height, width, 3) uint8."""
        assert self.gl is not None, "closed"
        self.gl.make_current()
        mujoco.mjr_render(self.rectangle, scene, self.context)
        frame = np.empty((self.rectangle.height, self.rectangle.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(frame, None, self.rectangle, self.context)
        return frame[::-1].copy()  # OpenGL counts rows from below

    def close(self) -> None:
        """Free what OpenGL holds; safe to call twice."""
        if self.gl is None:
            return
        self.gl.make_current()
        if self.context is not None:
            self.context.free()
        self.gl.free()
        self.gl = self.context = None

    def __del__(self) -> None:
        self.close()
