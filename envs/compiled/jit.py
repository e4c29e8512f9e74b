"""The one Numba decorator of this package, and its messages while it compiles."""

import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numba
from numba.core import event

from poise.configs.errors import ConfigError

from .cache_folder import file_folder, kernel_folder
from .kernel_cache import compiled_once, kept_in

#: Sums may be reordered (SIMD) and products fused into them, but NaN and infinity keep their
#: meaning: checks rely on them.
FAST = ("arcp", "contract", "nsz", "reassoc")


def fastmath(environment: Mapping[str, str]) -> set[str]:
    """LLVM's flags for floating-point numbers: none if `POISE_FASTMATH` is 0.

    Then every operation is rounded as the sources write it, as IEEE 754 has it. That is slower, and
    makes kernels of different processors agree to the bit, up to sines and the like.

    Raises:
        ConfigError: it is neither 0 nor 1.
    """
    switch = environment.get("POISE_FASTMATH", "1")
    if switch not in ("0", "1"):
        raise ConfigError(f"not a switch: {switch!r}", source="the environment",
                          field="POISE_FASTMATH", choices=("0", "1"))  # fmt: skip
    return set(FAST) if switch == "1" else set()


_FLAGS = fastmath(os.environ)
#: Of the cache of compiled kernels; None where there is none, and why.
CACHE, NO_CACHE = kernel_folder(sorted(_FLAGS))


kernels: WeakSet[Any] = WeakSet()  #: all that `compiled` has made, whether compiled yet or not


def compiled(function: Callable) -> Any:
    """Numba's decorator: cached on disk, without the GIL, NumPy's rules for division by zero."""
    folder = _folder(function)
    if folder is None:
        return _decorated(function, cache=False)
    with kept_in(folder):
        kernel = compiled_once(_decorated(function, cache=True), folder)
    kernels.add(kernel)
    return kernel


def _decorated(function: Callable, cache: bool) -> Any:
    return numba.njit(
        cache=cache,
        nogil=True,
        no_cfunc_wrapper=True,  # unused; it would cost a twentieth of the compilation
        error_model="numpy",
        fastmath=_FLAGS,
    )(function)


def _folder(function: Callable) -> Path | None:
    """Where the kernels of a function are kept; None: nowhere, nor are those without a file."""
    if CACHE is None:
        return None
    try:
        return file_folder(CACHE, function.__code__.co_filename)
    except OSError:
        return None


PATIENCE = 1.0  # [s] of compilation before a message is printed


def message(what: str) -> str:
    """The line that says what is compiled, and for how long."""
    if CACHE is None:
        return f"poise: compiling {what}, in every process again: no kernels are kept: {NO_CACHE}"
    return f"poise: compiling {what} for the first use: up to a minute, once"


class Patience(event.Listener):
    """Says on the standard error that compilation takes a while, and what is compiled.

    Kernels read from the cache raise no event, nor do a user's own functions count.
    """

    def __init__(self) -> None:
        self.depth, self.begun, self.announced = 0, 0.0, False

    def on_start(self, event: event.Event) -> None:
        if self.depth == 0:
            self.begun = time.perf_counter()
        self.depth += 1
        module = event.data["dispatcher"].py_func.__module__ or ""  # none, of a generated function
        ours = module.startswith("poise.")
        if ours and not self.announced and time.perf_counter() - self.begun > PATIENCE:
            self.tell(module.removeprefix("poise."))

    def tell(self, what: str) -> None:
        """Print the message; what is compiled in passing has none of its own from then on."""
        self.announced = True
        print(message(what), file=sys.stderr, flush=True)

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1


patience = Patience()
event.register("numba:compile", patience)
