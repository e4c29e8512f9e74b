"""A file of finished trials, one JSON line each, that survives a kill or an exhausted disk."""

import contextlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, Generic, TypeVar

from poise.configs.errors import PoiseError
from poise.configs.files import write_atomic
from poise.configs.reading import is_file, parse_json, read_lines

Key = TypeVar("Key")  # of a trial


def read_log(path: Path) -> tuple[list[tuple[Any, Any]], int]:
    """Return (key, value) of every line, and the number of unreadable lines.

    A missing file counts as empty. A line cut off by a kill or corrupted by a disk is left out.

    Raises:
        ConfigError: a file of more than 128 MiB.
    """
    entries, damaged = [], 0
    for line in read_lines(path) if is_file(path) else []:
        try:
            key, value = parse_json(line)
            entries.append((key, value))
        except (ValueError, TypeError):
            damaged += 1
    return entries, damaged


class TrialLog(Generic[Key]):
    """A log that is first rewritten with the given entries, then appended to in whole lines.

    Raises PoiseError if the file cannot be written.
    """

    def __init__(self, path: Path, entries: Mapping[Key, object]):
        self.path = path
        write_atomic(path, "".join(_line(key, value) for key, value in entries.items()))
        try:
            self._file: BinaryIO = path.open("ab", buffering=0)
        except OSError as error:
            raise self._error(error) from None

    def append(self, key: Key, value: object) -> None:
        """Write an entry to the disk, completely or not at all; raises PoiseError."""
        line, size = _line(key, value).encode(), os.stat(self.path).st_size
        try:
            left = memoryview(line)
            while left:  # what a full disk or a limit on files leaves out raises its own reason
                left = left[self._file.write(left) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            with contextlib.suppress(OSError):
                os.truncate(self.path, size)
            raise self._error(error) from None

    def close(self) -> None:
        """Close the file; appended entries stay."""
        self._file.close()

    def _error(self, error: OSError) -> PoiseError:
        return PoiseError(
            f"{self.path}: cannot be written ({error.strerror}); the finished trials are kept: "
            "run the same command again to continue"
        )


def _line(key: object, value: object) -> str:
    return json.dumps([key, value]) + "\n"
