"""Terminals of clusters: no encoding ends a command, and folders are held without their locks."""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from poise.configs.errors import PoiseError
from poise.training.running import folder_lock
from poise.training.running.folder_lock import ARRAY, FolderLock

TALK = """
import sys
from poise.training.running.terminal import speak_plainly, terminal
speak_plainly()
print("5° ≤ 3 N·m², \\u82b1")
print("out/\\udce9", file=sys.stderr)
terminal().print("[b]±2[/b] → ok")
"""


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "gbk", "utf-8"])
def test_what_an_encoding_lacks_is_written_out(encoding: str) -> None:
    """A path of any bytes, too; what it has stays."""
    run = subprocess.run(
        [sys.executable, "-c", TALK], capture_output=True, check=True,
        env={**os.environ, "PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"},
    )  # fmt: skip
    text = run.stdout.decode(encoding)
    wanted = {"ascii": "5deg <= 3 N*m2, ?", "latin-1": "5° <= 3 N·m², ?",
              "gbk": "5° ≤ 3 N·m2, 花", "utf-8": "5° ≤ 3 N·m², 花"}[encoding]  # fmt: skip
    assert wanted in text and "ok" in text
    assert run.stderr.decode(encoding).strip() == "out/?"


@pytest.mark.parametrize("nothing", [False, True])
def test_a_file_system_that_locks_no_folder(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    nothing: bool,
) -> None:
    """As NFS: a file in it is locked instead; where nothing can be, a line says so."""
    lock, folder = fcntl.flock, tmp_path / "out"

    def flock(file: int, how: int) -> None:
        if nothing or os.path.isdir(f"/proc/self/fd/{file}"):
            raise OSError(errno.EBADF if not nothing else errno.ENOLCK, "no locks available")
        lock(file, how)

    monkeypatch.setattr(folder_lock.fcntl, "flock", flock)
    with FolderLock(folder):
        if nothing:
            assert "the file system has no locks (no locks available)" in capsys.readouterr().err
        else:
            with pytest.raises(PoiseError, match=rf"process {os.getpid()} .*is writing there$"):
                FolderLock(folder)
        (folder / "result").touch()
    with FolderLock(folder):
        assert (folder / "result").exists()


def test_a_job_array_is_told_how_to_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ARRAY, "7")
    with FolderLock(tmp_path), pytest.raises(PoiseError, match=r"run 7 .*--out DIR/\$SLURM_ARRAY"):
        FolderLock(tmp_path)
