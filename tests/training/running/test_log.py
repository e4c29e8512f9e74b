"""training/running/log.py."""

from __future__ import annotations

import resource
from pathlib import Path

import pytest

from poise.configs.errors import PoiseError
from poise.training.running.log import TrialLog, read_log


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
    """The error names file, reason and remedy; the entries before are there, and no half one.

    The system's limit for a file's size refuses like a full disk: it takes a part of the line.
    """
    path = tmp_path / "log"
    log = TrialLog(path, {1: "a"})
    size = path.stat().st_size
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 5, before[1]))
    said = r"log: cannot be written \(File too large\).*are kept.*continue"
    try:
        for _ in range(2):
            with pytest.raises(PoiseError, match=said):
                log.append(2, "b")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.stat().st_size == size
    log.append(3, "c")
    log.close()
    assert read_log(path) == ([(1, "a"), (3, "c")], 0)
