"""Choose MuJoCo's off-screen renderer. Does not import MuJoCo, which reads the choice only once."""

import ctypes.util
import os
import sys

from poise.configs.errors import PoiseError


def choose_gl_backend() -> str | None:
    """Set ``MUJOCO_GL`` on Linux without a display; returns its value, None if it is not set.

    Call it before anything imports MuJoCo. A value set by the user stays. OSMesa comes first: it
    draws in software the same pictures on every machine; EGL comes next. On a machine with a GPU
    ``MUJOCO_GL=egl`` is faster. With a display, or on another system, MuJoCo's own choice is good.
    """
    # Mesa's cache of shaders is a thread of least priority: on a busy machine it ends seconds late
    # (sched(7): nice 19), and the process with it. To do without costs a report a second.
    os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")
    load_osmesa_alone()
    chosen = os.environ.get("MUJOCO_GL")
    display = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if chosen or not sys.platform.startswith("linux") or "mujoco" in sys.modules or display:
        return chosen
    for backend, library in (("osmesa", "OSMesa"), ("egl", "EGL")):
        if ctypes.util.find_library(library):
            os.environ["MUJOCO_GL"] = backend
            load_osmesa_alone()
            return backend
    return None


def load_osmesa_alone() -> None:
    """Load OSMesa, if MuJoCo is to draw with it, so that other libraries do not see its symbols.

    Call it before anything imports MuJoCo. PyOpenGL, which loads OSMesa for MuJoCo, shows its
    symbols to all that is loaded later. Mesa brings an LLVM with it, which would take the place of
    Triton's own: a build of torch with CUDA would end the process when it makes an optimizer.

    Raises PoiseError where the library is not installed: MuJoCo could not be imported.
    """
    if os.environ.get("MUJOCO_GL", "").lower() != "osmesa" or "OpenGL.platform" in sys.modules:
        return
    os.environ.setdefault("PYOPENGL_PLATFORM", "osmesa")  # as MuJoCo does
    names, shown = vars(ctypes), ctypes.RTLD_GLOBAL
    names["RTLD_GLOBAL"] = ctypes.RTLD_LOCAL  # PyOpenGL has no setting of it
    try:
        from OpenGL.platform import PLATFORM

        found = PLATFORM.GL is not None
    except Exception:
        found = True  # MuJoCo tells what is missing
    finally:
        names["RTLD_GLOBAL"] = shown
    if not found:
        raise PoiseError(
            "MUJOCO_GL=osmesa, but OSMesa is not installed: install the package libosmesa6 "
            "(Debian, Ubuntu), or set MUJOCO_GL=egl where there is a GPU"
        )
