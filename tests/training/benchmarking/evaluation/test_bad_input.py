"""A benchmark that is killed, or meets a full disk: no finished trial is lost or played again."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from poise.training.benchmarking.evaluation.evaluate import benchmark
from poise.training.cli.entry import main
from poise.training.running import log as trial_log
from tests.support.benchmarks_small import TRIALS, InProcessExecutor, play_in_process, write_small

ROOT = Path(__file__).parents[4]
BOTH = ("momentum-qp", "zero")
KILLED = """
import os, signal
from poise.training.benchmarking.evaluation.folder import ResultFolder
from poise.training.benchmarking.evaluation.evaluate import benchmark
append = ResultFolder.append
def and_die(folder, *rest):
    append(folder, *rest)
    if len(folder.finished) == 5:
        os.kill(os.getpid(), signal.SIGKILL)
ResultFolder.append = and_die
benchmark({both!r}, {suite!r}, out={out!r}, workers=2)
"""


@pytest.fixture(autouse=True)
def in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcessExecutor]:
    """Trials are played in this process, and ticks are not timed."""
    return play_in_process(monkeypatch)


def lines(folder: Path) -> int:
    """Whole lines of the log."""
    log = folder / "trials.jsonl"
    return log.read_bytes().count(b"\n") if log.exists() else 0


def test_a_kill_in_the_middle_loses_no_finished_trial(
    tmp_path: Path, in_process: type[InProcessExecutor]
) -> None:
    """SIGKILL of the command with two processes: they end too, the rest is played, once."""
    suite, out = write_small(tmp_path), tmp_path / "out"
    code = KILLED.format(both=BOTH, suite=str(suite), out=str(out))
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, start_new_session=True,
    )  # fmt: skip
    shown, _ = process.communicate(timeout=300)
    assert process.returncode == -signal.SIGKILL, shown
    with pytest.raises(ProcessLookupError):  # no worker of the session is left
        for _ in range(100):
            os.killpg(process.pid, 0)
            time.sleep(0.1)
    kept = lines(out)
    assert kept == 5 and not (out / "summary.json").exists()
    benchmark(BOTH, suite, out=out)
    assert in_process.played == 2 * TRIALS - kept
    benchmark(BOTH, suite, out=tmp_path / "whole")
    assert (out / "trials.csv").read_bytes() == (tmp_path / "whole/trials.csv").read_bytes()


def short_command(folder: Path) -> list[str]:
    """`poise benchmark` of the envelope alone, to `folder`/out."""
    suite = write_small(folder, mix=None, factors=None)
    command = ["benchmark", "--suite", str(suite), "--out", str(folder / "out"), "--no-report"]
    return [*command, "--controllers", "zero"]


def test_a_full_disk_loses_no_finished_trial(
    tmp_path: Path,
    in_process: type[InProcessExecutor],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One line that names the file and exit code 2; the same command goes on."""
    out, command = tmp_path / "out", short_command(tmp_path)
    written = 0

    def full(file: int) -> None:
        nonlocal written
        written += 1
        if written == 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(trial_log.os, "fsync", full)
        assert main(command) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "trials.jsonl: cannot be written (No space left" in error
    kept, total = lines(out), 4 + 4 + 2
    assert kept >= 1 and in_process.played < total
    in_process.played = 0
    assert main(command) == 0
    assert in_process.played == total - kept and lines(out) == total


def test_a_disk_that_is_full_at_the_end(
    tmp_path: Path,
    in_process: type[InProcessExecutor],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The table of trials does not fit: no half file, and nothing is played again."""
    out, command = tmp_path / "out", short_command(tmp_path)
    real = os.replace

    def full(source: Path, target: Path) -> None:
        if Path(target).name == "trials.csv":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        assert main(command) == 2
    assert "trials.csv: cannot be written (No space left" in capsys.readouterr().err
    assert {path.name for path in out.iterdir()} == {"settings.yaml", "trials.jsonl"}
    in_process.played = 0
    assert main(command) == 0 and in_process.played == 0
    assert (out / "summary.json").exists()


def test_overwriting_removes_the_old_report(
    tmp_path: Path, in_process: type[InProcessExecutor]
) -> None:
    """Stopped right after --overwrite, the folder shows nothing of before."""
    suite, out = write_small(tmp_path, mix=None, factors=None), tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("of before")
    in_process.stop_after = 0
    with pytest.raises(KeyboardInterrupt):
        benchmark(["zero"], suite, out=out, overwrite=True)
    assert {path.name for path in out.iterdir()} == {"settings.yaml", "trials.jsonl"}
