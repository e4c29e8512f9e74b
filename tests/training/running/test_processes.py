"""training/running/{processes,executor}.py: who does a job when a worker dies."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError, PoiseError
from poise.training.running.executor import Executor
from poise.training.running.processes import PendingJob, Worker, WorkerTraceback


class Unportable(Exception):
    """Cannot be built from its text alone."""

    def __init__(self, text: str, more: int):
        super().__init__(text)


def work(job: tuple[str, Path | int]) -> tuple[str, int]:
    """What the job says; returns it with the process that has done it."""
    what, more = job
    if what.startswith("die") and isinstance(more, Path):
        with more.open("a") as file:
            file.write("x")
        if what == "die" or more.stat().st_size == 1:
            os.kill(os.getpid(), signal.SIGKILL)
    if what == "memory" and isinstance(more, Path) and not more.exists():
        more.touch()
        raise MemoryError
    if what == "wait" and isinstance(more, Path):
        more.touch()
        while more.exists():
            time.sleep(0.02)
    if what == "config":
        raise ConfigError("is not there", field="robot", choices=("a", "b"))
    if what == "unportable":
        raise Unportable("odd", 1)
    return what, os.getpid()


def test_what_a_dead_worker_was_at_is_done_by_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Killed once, or out of memory once: one line each, every job is done, the others stay."""
    jobs = [("die once", tmp_path / "die"), *(("plain", k) for k in range(20)),
            ("memory", tmp_path / "memory")]  # fmt: skip
    with Executor("local", 2) as executor:
        done = list(executor.each(work, jobs))
        assert sorted(map(str, jobs)) == sorted(str(job) for job, _ in done)
        assert len({process for _, (_, process) in done}) <= 4
        again = {process for _, (_, process) in executor.each(work, [("plain", 1)])}
        assert again <= {process for _, (_, process) in done}  # they stay for the next jobs
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and all("its work is repeated" in line for line in told)
    assert any("SIGKILL" in line for line in told) and any(
        "out of memory:" in line for line in told
    )
    assert not multiprocessing.active_children()


def test_a_job_that_kills_two_workers_is_an_error(tmp_path: Path) -> None:
    """No third one; what was done before stays done, and no process is left."""
    done = []
    with pytest.raises(PoiseError, match="by SIGKILL.*as did another.*same command again"):
        with Executor("local", 1) as executor:
            for job, _ in executor.each(
                work, [("plain", 0), ("die", tmp_path / "die"), ("plain", 1)]
            ):
                done.append(job)
    assert done == [("plain", 0)] and (tmp_path / "die").read_text() == "xx"
    assert not multiprocessing.active_children()


def test_a_worker_whose_main_process_has_gone_just_ends(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Nobody takes its result: it says nothing."""
    worker = Worker()
    worker.give(PendingJob(work, ("wait", tmp_path / "there")))
    while not (tmp_path / "there").exists():
        time.sleep(0.02)
    worker.connection.close()
    (tmp_path / "there").unlink()
    worker.process.join(60)
    assert worker.process.exitcode == 0
    assert capfd.readouterr().err == ""


def test_joblib_does_the_work_of_the_dead_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Once; then it is the same error."""
    with Executor("joblib", 2) as executor:
        jobs = [("die once", tmp_path / "die"), *(("plain", k) for k in range(4))]
        assert len(list(executor.each(work, jobs))) == 5
    assert capsys.readouterr().err.count("its work is repeated") == 1
    with (
        pytest.raises(PoiseError, match="twice on the same work"),
        Executor("joblib", 2) as executor,
    ):
        list(executor.each(work, [("die", tmp_path / "die2")]))


def test_what_a_job_raises_is_raised_here() -> None:
    """With its fields, and where it came from; an error that cannot be pickled by its words."""
    with Executor("local", 1) as executor:
        with pytest.raises(ConfigError, match="robot: is not there .choices: a, b") as error:
            list(executor.each(work, [("config", 0)]))
        assert error.value.field == "robot"
        assert isinstance(error.value.__cause__, WorkerTraceback)
        with pytest.raises(RuntimeError, match="Unportable: odd"):
            list(executor.each(work, [("unportable", 0)]))
        assert next(executor.each(work, [("plain", 0)]))[1][0] == "plain"


@pytest.mark.parametrize("call", ["evaluate(['momentum-qp'], 'random', trials=2, out='out')"])
def test_a_script_without_a_guard_is_told_of_it(call: str, tmp_path: Path) -> None:
    """One error, and nothing of what multiprocessing says in every worker."""
    script = tmp_path / "script.py"
    script.write_text(f"import poise\npoise.{call}\n")
    result = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 1 and result.stderr.count("Traceback") == 1
    assert "put its code under `if __name__ == '__main__':`" in result.stderr.splitlines()[-1]
