"""MuJoCo's C functions, callable from Numba code that has released the GIL.

`mj_step1` computes everything that depends on position and velocity; `mj_step2` takes the
controls and finishes the step. Symbols are registered by name, so compiled code that calls
them can be cached on disk.
"""

import ctypes
from pathlib import Path
from typing import Any

import llvmlite.binding
import mujoco
from numba.core import types


def _register(names: tuple[str, ...]) -> None:
    """Make MuJoCo's own shared library visible to LLVM under the functions' names."""
    folder = Path(mujoco.__file__).parent
    patterns = ("libmujoco.so*", "libmujoco*.dylib", "mujoco.dll")
    libraries = [path for pattern in patterns for path in sorted(folder.glob(pattern))]
    if not libraries:
        raise ImportError(f"no MuJoCo library in {folder} (looked for {', '.join(patterns)})")
    library = ctypes.CDLL(str(libraries[0]))
    for name in names:
        address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
        llvmlite.binding.add_symbol(name, address)


_register(("mj_step1", "mj_step2"))

_signature = types.void(types.intp, types.intp)
mj_step1: Any = types.ExternalFunction("mj_step1", _signature)
mj_step2: Any = types.ExternalFunction("mj_step2", _signature)
