"""A small evaluation and a small benchmark, finished, to be broken."""

from __future__ import annotations

import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

import pytest

from poise.training.benchmarking.evaluation import run
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import benchmark, evaluate
from tests.support.benchmarks_small import InProcessExecutor, write_small
from tests.support.evaluations import RANDOM, InProcess, write_suite

CONTROLLERS = ("zero", "pd")
PLACE = "POISE_FUZZ_SAMPLES"  # environment variable: where a parent process has made them
_folders: list[tempfile.TemporaryDirectory] = []  # removed at the end of the process


@cache
def samples() -> Path:
    """The folder of both, `evaluation` and `benchmark`; do not write into it."""
    if PLACE in os.environ:
        return Path(os.environ[PLACE])
    _folders.append(tempfile.TemporaryDirectory(prefix="poise-fuzz-"))
    path = Path(_folders[-1].name)
    make_samples(path)
    return path


def make_samples(path: Path) -> None:
    """Play both in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, "Executor", InProcess)
        patch.setattr(run, "Executor", InProcessExecutor)
        patch.setattr(run, "tick_times", lambda agents: dict.fromkeys(agents, 12.5))
        suite = write_suite(path, RANDOM)
        evaluate(CONTROLLERS, suite, out=path / "evaluation", seed=4)
        benchmark(CONTROLLERS, write_small(path), out=path / "benchmark", seed=2)


def copy_sample(name: str, to: Path) -> Path:
    """A copy that may be changed."""
    return Path(shutil.copytree(samples() / name, to / name))
