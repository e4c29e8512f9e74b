"""training/trial_log.py."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from poise.envs.errors import PoiseError
from poise.training.trial_log import TrialLog, read_log


def test_entries_come_back(tmp_path: Path) -> None:
    """In their order; what the file is to begin with and what is appended."""
    path = tmp_path / "log"
    assert read_log(path) == ([], 0)
    log = TrialLog(path, {1: "a"})
    log.append(("x", 2), {"b": 0.1 + 0.2})
    assert read_log(path) == ([(1, "a"), (["x", 2], {"b": 0.1 + 0.2})], 0)
    log.close()


def test_spoiled_lines_cost_no_other(tmp_path: Path) -> None:
    """A line cut off by a kill, and one that a disk has spoiled."""
    path = tmp_path / "log"
    log = TrialLog(path, {1: "a", 2: "b", 3: "c"})
    log.close()
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b"\xff\x00\n" + lines[2] + b'[4, "d')
    assert read_log(path) == ([(1, "a"), (3, "c")], 2)


def test_a_full_disk_is_one_line_and_keeps_what_was_written(tmp_path: Path) -> None:
    """The error names the file and says what to do; the entries before are there."""
    path = tmp_path / "log"
    log = TrialLog(path, {1: "a"})

    class Full:
        def write(self, text: str) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

        def close(self) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    log._file.close()
    log._file = Full()
    with pytest.raises(PoiseError, match="log: cannot be written .No space.*are kept.*go on"):
        log.append(2, "b")
    log.close()
    assert read_log(path) == ([(1, "a")], 0)
