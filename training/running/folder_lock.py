"""An output folder: one writer at a time, and either new or continued with --resume."""

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
from poise.configs.reading import MIB, read_text

HOLDER = ".poise.lock"  # names the process that holds the lock; meaningless after a kill
#: environment variable: index of a run in a job array
ARRAY = "SLURM_ARRAY_TASK_ID"
#: errors of cluster file systems that cannot lock a folder, or lock nothing
NO_LOCKS = (errno.EBADF, errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
#: a received folder may hold a link, through which another file would be written, or a pipe
OPEN = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC


class FolderLock(contextlib.AbstractContextManager):
    """Lock a folder until `release` or the end of the process; also a context.

    The folder is created if missing, and removed again if it stays empty. The operating system
    releases the lock of a dead process. Partial files of killed processes are removed. Where the
    file system cannot lock a folder, a file in it is locked; where it has no locks at all, a
    warning line is printed.

    Raises:
        PoiseError: another process, which is named, holds the lock, the folder cannot be created,
            or the file that names the process is a link.
    """

    def __init__(self, path: Path):
        self.path, self._file = path, -1
        self._made = not path.exists()
        try:
            path.mkdir(parents=True, exist_ok=True)
            if (path / HOLDER).is_symlink():
                raise PoiseError(f"{path / HOLDER}: is a link, as no run leaves one: remove it")
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
        with contextlib.suppress(OSError):  # an exhausted disk is reported by later writes
            with open(os.open(path / HOLDER, OPEN, 0o644), "wb", buffering=0) as file:
                file.truncate()
                file.write(text.encode("utf-8", "replace"))
        _remove_parts(path)

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise
            os.close(self._file)
            self._file = os.open(self.path / HOLDER, OPEN, 0o644)
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
        """Release the lock."""
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
    """Raise ConfigError unless `resume` matches whether there is something to continue.

    `held` and `kind` name it, such as "a training run" and "run".
    """
    if there and not resume:
        raise ConfigError(f"already holds {held}; continue with --resume or choose another folder",
                          source=out, field="out")  # fmt: skip
    if resume and not there:
        raise ConfigError(f"holds no {kind} to resume", source=out, field="resume")


def _of_array() -> str:
    """Return advice for a run of a job array that shares its folder with others."""
    index = os.environ.get(ARRAY)
    return "" if index is None else (
        f"; this is run {index} of a job array: give each run its own folder and seed, such as "
        f"--out DIR/${ARRAY} --seed ${ARRAY}"
    )  # fmt: skip


def _holder(path: Path) -> str:
    """Describe the process that holds the lock."""
    try:
        process, command, host = read_text(path / HOLDER, MIB).splitlines()
    except (ConfigError, ValueError):
        return "another process"
    elsewhere = f" on {host}" if host != socket.gethostname() else ""
    return f"process {process}{elsewhere} ({command})"


def _remove_parts(path: Path) -> None:
    """Remove partial files that killed calls of `write_atomic` and `video.record` left."""
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
    except (OSError, OverflowError):  # a process of another user
        return True
    return True
