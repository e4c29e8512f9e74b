"""The folder of compiled kernels: writable by the user alone, because kernels are unpickled.

A file of the cache runs code in the process that reads it. So the folder belongs to the user, is
closed to others, and lies where others cannot replace it. It must not come with a project that the
user works on: folders below the working folder are refused, except beside these sources, which are
run anyway, and in the caches of a home that itself lies there.
"""

import contextlib
import hashlib
import os
import platform
import shutil
import stat
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import llvmlite.binding
import numba
import numpy as np

from .sources import source_digest

_ROOM = Path(__file__).resolve().parents[1]
_BESIDE = _ROOM / "__pycache__"
KEPT = 4  #: folders of one kind that stay, the last ones used: of other versions, other branches


def processor() -> str:
    """Name and features that Numba compiles for: the host's, or NUMBA_CPU_NAME and its like."""
    name, features = numba.config.CPU_NAME, numba.config.CPU_FEATURES
    if features is None:
        with contextlib.suppress(RuntimeError):  # LLVM does not know them on every platform
            features = llvmlite.binding.get_host_cpu_features().flatten()
    return f"{name or llvmlite.binding.get_host_cpu_name()} {features}"


def kernel_folder(flags: object) -> tuple[Path | None, str]:
    """The folder of kernels compiled with these flags, made if need be; or None, and why not."""
    versions = (platform.python_version(), np.__version__, numba.__version__, llvmlite.__version__)
    key = f"{_ROOM} {versions} {processor()} {flags}"
    name = f"kernels-{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    problem = "there is nowhere to keep them"
    for root in _roots():
        try:
            folder = _usable(root, name)
        except OSError as error:
            problem = f"{root}: {error.strerror or error}"
        else:
            return folder, ""
    return None, problem


@cache
def file_folder(kernels: Path, file: str) -> Path:
    """The folder in `kernels` of what is compiled from this version of `file` and its imports.

    Raises:
        OSError: the file cannot be read, or the folder not be made.
    """
    name = ".".join(Path(file).with_suffix("").parts[-2:])
    return _made(kernels, f"{name}-{source_digest(file)[:16]}")


def _roots() -> Iterator[Path]:
    """Folders that may hold caches, the best one first."""
    if numba.config.CACHE_DIR:
        yield Path(numba.config.CACHE_DIR) / "poise"
    else:
        yield _BESIDE
        yield Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")) / "poise"


def _usable(root: Path, name: str) -> Path:
    """The folder `name` of a root, made if need be; OSError, where it is not to be trusted."""
    if not root.is_absolute():
        raise OSError("is no absolute path")
    real = root.resolve()
    if real != _BESIDE and _below_working_folder(real):
        raise OSError("lies below the working folder")
    check_trust(real)
    folder = _made(real, name)
    check_trust(folder)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OSError("cannot be written")
    return folder


def _below_working_folder(path: Path) -> bool:
    """Return whether a path lies in the project worked on; a home that lies there is trusted."""
    here, home = Path.cwd(), Path(os.path.expanduser("~"))
    own = home.is_absolute() and here in (home.resolve(), *home.resolve().parents)
    return here in path.parents and not own


def check_trust(folder: Path) -> None:
    """Refuse a folder that another user can write to or replace.

    Its owner, and those of the folders above, are the user or the system; of a folder that does
    not exist, those above count.

    Raises:
        OSError: with the reason.
    """
    trusted = {os.geteuid(), 0, os.stat("/").st_uid}  # the system's: 0, or what stands for it here
    for place in (folder, *folder.parents):
        with contextlib.suppress(FileNotFoundError):
            seen = os.lstat(place)
            if not stat.S_ISDIR(seen.st_mode):
                raise OSError(f"{place} is no folder")
            if seen.st_uid not in trusted:
                raise OSError(f"{place} belongs to another user")
            if _open(seen) and (place == folder or not seen.st_mode & stat.S_ISVTX):
                raise OSError(f"others may write to {place}")


def _open(seen: os.stat_result) -> bool:
    """Whether others can write to a folder; those of the user's own group are the user."""
    group = seen.st_mode & stat.S_IWGRP and seen.st_gid != os.getegid()
    return bool(seen.st_mode & stat.S_IWOTH or group)


def _made(parent: Path, name: str) -> Path:
    """The folder `name`, as the last one used of its kind; what came before `KEPT` others goes."""
    folder = parent / name
    if folder.is_dir():
        with contextlib.suppress(OSError):  # of a cache that can be read only
            os.utime(folder)
        return folder
    for place in reversed((folder, *folder.parents)):
        if not place.is_dir():
            place.mkdir(mode=0o700, exist_ok=True)
    kind = name.rpartition("-")[0]
    older = sorted(parent.glob(f"{kind}-*"), key=_used, reverse=True)[KEPT:]
    for place in older:
        shutil.rmtree(place, ignore_errors=True)
    return folder


def _used(folder: Path) -> float:
    """When a folder was used last [s]; 0, where another process has just removed it."""
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0
