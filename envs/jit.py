"""The one Numba decorator of this package, and a cache that notices changed sources."""

import contextlib
import hashlib
from pathlib import Path

import numba

#: Compiled without the GIL, cached on disk, NumPy's rules for division by zero. Sums may be
#: reordered (SIMD), but NaN and infinity keep their meaning: checks rely on them.
compiled = numba.njit(
    nogil=True,
    cache=True,
    error_model="numpy",
    fastmath={"contract", "reassoc", "nsz", "arcp"},
)


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
