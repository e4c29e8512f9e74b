"""The one Numba decorator of this package, and a cache that notices changed sources."""

import contextlib
import hashlib
import sys
import time
from pathlib import Path

import numba
from numba.core import event

#: Cached on disk, without the GIL, NumPy's rules for division by zero. Sums may be reordered
#: (SIMD), but NaN and infinity keep their meaning: checks rely on them.
compiled = numba.njit(
    cache=True,
    nogil=True,
    no_cfunc_wrapper=True,  # of which nobody makes use; a twentieth of the compilation
    error_model="numpy",
    fastmath={"contract", "reassoc", "nsz", "arcp"},
)

PATIENCE = 1.0  # [s] of compilation before the user is told
MESSAGE = "poise: compiling for the first use; this takes twenty to thirty seconds, once"


class Patience(event.Listener):
    """Says on the standard error, once in a process, that compilation takes a while.

    Kernels read from the cache raise no event, nor do a user's own functions count.
    """

    def __init__(self) -> None:
        self.depth, self.begun, self.told = 0, 0.0, False

    def on_start(self, event: event.Event) -> None:
        if self.depth == 0:
            self.begun = time.perf_counter()
        self.depth += 1
        ours = event.data["dispatcher"].py_func.__module__.startswith("poise.")
        if ours and time.perf_counter() - self.begun > PATIENCE:
            self.tell()

    def tell(self) -> None:
        if not self.told:
            self.told = True
            print(MESSAGE, file=sys.stderr, flush=True)

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1


_patience = Patience()
event.register("numba:compile", _patience)


def tell() -> None:
    """The message, once in a process."""
    _patience.tell()


def quiet() -> None:
    """No message from this process: the one that started it has told."""
    _patience.told = True


_ROOM = Path(__file__).resolve().parent
#: Holds the digest of the sources that the cached kernels were compiled from.
CACHE_STAMP = _ROOM / "__pycache__" / "kernels.sha256"


def drop_stale_kernels(packages: list[Path]) -> bool:
    """Delete compiled kernels that sources of `packages` have outdated; True if any were.

    Numba looks only at the file of the cached function itself, not at the functions that were
    compiled into it from other files: after an update it would run the old code.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for package in packages:
        for path in sorted(package.rglob("*.py")):
            digest.update(path.read_bytes())
    stamp = packages[0] / "__pycache__" / CACHE_STAMP.name
    with contextlib.suppress(OSError):
        if stamp.is_file() and stamp.read_text() == digest.hexdigest():
            return False
        for package in packages:
            for pattern in ("*.nbi", "*.nbc"):
                for path in package.rglob(pattern):
                    path.unlink(missing_ok=True)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(digest.hexdigest())
    return True


drop_stale_kernels([_ROOM, _ROOM.parent / "baselines"])
