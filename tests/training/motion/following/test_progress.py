"""training/motion/following/progress.py: how far the trials of a performance have come."""

import io
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from poise.training.benchmarking.trials.trial import Trial
from poise.training.motion.following.progress import FollowProgress


def test_lines_say_trial_and_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other watch is called at every step; a step of 10 s is a line."""
    clock = iter(range(0, 10_000, 60))
    monkeypatch.setattr(
        "poise.training.running.terminal.time.monotonic", lambda: float(next(clock))
    )
    seen: list[tuple[int, float]] = []

    def others(trial: Trial) -> Any:
        return lambda env: seen.append((trial.number, env.simulation.time))

    screen = io.StringIO()
    with FollowProgress(2, Console(file=screen, width=100), others, True) as progress:
        for number in range(2):
            watch = progress(Trial(number, number))
            for time in (0.0, 0.1, 10.0):
                env: Any = SimpleNamespace(simulation=SimpleNamespace(time=time))
                watch(env)
    assert seen == [(k, time) for k in range(2) for time in (0.0, 0.1, 10.0)]
    assert "trial 1, filmed: 0 s" in screen.getvalue()
    lines = [line for line in screen.getvalue().splitlines() if line.startswith("trials 0/2")]
    assert lines[0].endswith("trial 1, filmed: 0 s") and lines[-1].endswith("filmed: 10 s")
    assert " 2/2 " in screen.getvalue()


def test_what_fails_is_not_done() -> None:
    """Nothing says that all trials are there."""
    screen = io.StringIO()
    with (
        pytest.raises(ZeroDivisionError),
        FollowProgress(2, Console(file=screen, width=100)) as progress,
    ):
        progress(Trial(0, 0))
        raise ZeroDivisionError
    assert "2/2" not in screen.getvalue()
