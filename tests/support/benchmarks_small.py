"""Small benchmarks for tests: a suite of seconds, and a executor that plays in this process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from poise.training.benchmarking.evaluation import run
from tests.support.evaluations import InProcess

SMALL: dict[str, Any] = {
    "duration": 1.6,
    "start": 0.1,
    "interval": 0.3,
    "envelope": {"directions": 2, "fractions": [0.2, 2.0], "first_trials": 2, "trials": 2},
    "margin": {"directions": [90], "levels": [0.2, 3.0], "runs": 1},
    "factors": {
        "trials": 1,
        "levels": {"friction": [0.4], "delay": [0.02], "mass_error": [0.1], "pushes": [2]},
    },
    "mix": {"trials": 2, "delay": [0.008]},
}
TRIALS = 4 + 4 + 2 + 5 + 2  # of one controller


def write_small(folder: Path, **changes: Any) -> Path:
    """The suite's file."""
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump({**SMALL, **changes}))
    return path


def play_in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcessExecutor]:
    """Trials are played in this process, and ticks are not timed."""
    monkeypatch.setattr(run, "Executor", InProcessExecutor)
    monkeypatch.setattr(run, "tick_times", lambda agents: dict.fromkeys(agents, 12.5))
    InProcessExecutor.played, InProcessExecutor.stop_after = 0, None
    return InProcessExecutor


class InProcessExecutor(InProcess):
    """With a count of its own."""
