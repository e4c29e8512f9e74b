"""A folder that is written to: by one process at a time, and only anew or with --resume."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import shlex
import socket
import sys
from pathlib import Path

from poise.configs.errors import ConfigError, PoiseError

HOLDER = ".poise.lock"  # who holds the lock: of a process that was killed it says nothing
#: of the environment: the number of a run among several of one command
ARRAY = "SLURM_ARRAY_TASK_ID"
#: what file systems of clusters say that do not lock a folder, or nothing at all
NO_LOCKS = (errno.EBADF, errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)


class FolderLock(contextlib.AbstractContextManager):
    """Holds a folder until `release`, or the end of the process; also as a context.

    The folder is made if missing, and an empty one that it has made goes again. The system keeps
    the lock, so that one of a dead process blocks nobody. Files that a killed process has left
    half-written go. Where a file system locks no folder, a file in it is locked; where it locks
    nothing, a line says so.

    Raises PoiseError when another process holds it, which it names, or the folder cannot be made.
    """

    def __init__(self, path: Path):
        self.path, self._file = path, -1
        self._made = not path.exists()
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDONLY)
            self._lock()
        except BlockingIOError:
            os.close(self._file)
            self._file = -1
            raise PoiseError(f"{path}: {_holder(path)} is writing there{_of_array()}") from None
        except OSError as error:
            raise PoiseError(f"{path}: cannot be written ({error.strerror})") from None
        command = shlex.join([os.path.basename(sys.argv[0]), *sys.argv[1:]]).replace("\n", " ")
        text = f"{os.getpid()}\n{command}\n{socket.gethostname()}\n"
        with contextlib.suppress(OSError):  # a full disk: the run says so where it matters
            (path / HOLDER).write_text(text, "utf-8", "replace")
        _remove_parts(path)

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise
            os.close(self._file)
            self._file = os.open(self.path / HOLDER, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as second:
                if second.errno not in NO_LOCKS:
                    raise
                print(f"poise: {self.path}: the file system has no locks ({second.strerror}): see "
                      "to it that no other run writes there", file=sys.stderr)  # fmt: skip

    def __exit__(self, *error: object) -> None:
        self.release()

    def release(self) -> None:
        """Let others write."""
        if self._file < 0:
            return
        with contextlib.suppress(OSError):
            (self.path / HOLDER).unlink()
        if self._made:
            with contextlib.suppress(OSError):  # something was written
                self.path.rmdir()
        os.close(self._file)
        self._file = -1

    def __del__(self) -> None:
        if self._file >= 0:
            self.release()


def check_resume(out: Path, resume: bool, there: bool, held: str, kind: str) -> None:
    """Raise ConfigError unless `resume` says whether there is something to go on with.

    `held` and `kind` name that, such as "a training run" and "run".
    """
    if there and not resume:
        raise ConfigError(f"already holds {held}; go on with --resume or choose another folder",
                          source=out, field="out")  # fmt: skip
    if resume and not there:
        raise ConfigError(f"holds no {kind} to resume", source=out, field="resume")


def _of_array() -> str:
    """What a run of a job array is to do that shares its folder with the others."""
    index = os.environ.get(ARRAY)
    return "" if index is None else (
        f"; this is run {index} of a job array: give each a folder and a seed of its own, such as "
        f"--out DIR/${ARRAY} --seed ${ARRAY}"
    )  # fmt: skip


def _holder(path: Path) -> str:
    """The process that holds the lock, in words."""
    try:
        process, command, host = (path / HOLDER).read_text("utf-8").splitlines()
    except (OSError, ValueError):
        return "another process"
    elsewhere = f" on {host}" if host != socket.gethostname() else ""
    return f"process {process}{elsewhere} ({command})"


def _remove_parts(path: Path) -> None:
    """Remove what `write_atomic` and `video.record` left unfinished when they were killed."""
    for part in path.glob(".*.part*"):
        found = re.fullmatch(r"\..*\.(\d+)\.part(\.mp4)?", part.name)
        if found and not _alive(int(found[1])):
            with contextlib.suppress(OSError):
                part.unlink()


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is of another user
        return True
    return True
