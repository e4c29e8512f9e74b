"""Small evaluations for tests: short suites, and a executor that plays in this process."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Self

import yaml

PUSHES = {"magnitude": [0.05, 2.5], "unit": "ankle_fraction", "start": [0.1, 0.1]}
RANDOM = {"duration": 1.6, "random": {"trials": 4, "pushes": PUSHES}}
ENVELOPE = {
    "duration": 1.6,
    "start": 0.1,
    "envelope": {
        "directions": 2, "impulses": [0.05, 1.2], "first_trials": 3, "trials": 2, "paired": True,
    },
}  # fmt: skip


def random_suite(trials: int) -> dict[str, Any]:
    """`RANDOM` with another number of trials."""
    return {**RANDOM, "random": {"trials": trials, "pushes": PUSHES}}


def write_suite(folder: Path, fields: dict[str, Any], name: str = "suite") -> Path:
    """A suite's file."""
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(fields))
    return path


class InProcess:
    """Works like `Executor`, without processes; `played` counts jobs, `stop_after` interrupts."""

    played = 0
    stop_after: int | None = None

    def __init__(self, backend: str, workers: int | None):
        self.backend, self.workers = backend, 1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def each(
        self, function: Callable[[Any], Any], jobs: Sequence[Any]
    ) -> Iterator[tuple[Any, Any]]:
        counted = type(self)
        for job in reversed(jobs):  # any order must do
            if counted.stop_after is not None and counted.played >= counted.stop_after:
                raise KeyboardInterrupt
            counted.played += 1
            yield job, function(job)
