"""Small finished results for the tests of the report: made once, copied to be broken."""

from __future__ import annotations

import functools
import shutil
import tempfile
from pathlib import Path

import pytest

from poise.training.benchmarking.evaluation import run
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import benchmark, evaluate
from tests.support.benchmarks_small import InProcessExecutor, write_small
from tests.support.evaluations import ENVELOPE, InProcess, random_suite, write_suite

SOFT = 'a "soft" <b>&.yaml'  # a name that must be escaped wherever it is written
WALKS = {
    "duration": 7.0,
    "walk": {"commands": [{"ahead": 0.0}, {"ahead": -0.3}], "trials": 1},
    "walk_push": {"command": {"ahead": 0.4}, "directions": 2, "impulses": [0.1, 1.4],
                  "first_trials": 4, "trials": 4, "start": 4.0},
}  # fmt: skip
_folders: list[tempfile.TemporaryDirectory] = []  # removed at the end of the process


@functools.cache
def finished(kind: str) -> Path:
    """A finished result of a controller's file and of no control; do not write into it.

    Args:
        kind: "random" or "envelope" of `poise evaluate`, or "benchmark"; "envelope-steps" and
            "benchmark-steps" with a controller that steps instead of no control; "walk" of `walk`
            alone, at two commands and pushed.
    """
    _folders.append(tempfile.TemporaryDirectory(prefix="poise-report-"))
    path = Path(_folders[-1].name)
    (path / SOFT).write_text("kind: momentum-qp\ncom: {stiffness: 5.0}\n")
    kind, _, steps = kind.partition("-")
    names = [str(path / SOFT), "capture-step" if steps else "zero"]
    if kind == "benchmark":
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(run, "Executor", InProcessExecutor)
            patch.setattr(run, "tick_times", lambda agents: dict.fromkeys(agents, 12.5))
            InProcessExecutor.stop_after = None
            benchmark(names, write_small(path), out=path / "out", seed=2)
        return path / "out"
    fields = {"random": random_suite(8), "envelope": ENVELOPE, "walk": WALKS}[kind]
    names = ["walk"] if kind == "walk" else names
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, "Executor", InProcess)
        InProcess.stop_after = None
        suite = write_suite(path, fields)
        evaluate(names, suite, out=path / "out", seed=4)
    return path / "out"


def copied(kind: str, to: Path) -> Path:
    """A copy of the evaluation, to be changed."""
    return Path(shutil.copytree(finished(kind), to / "copy"))
