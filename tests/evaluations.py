"""Small evaluations for tests: short suites, and trials played in this process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from poise.envs.robot import load_robot
from poise.training.players import load_player
from poise.training.trials import Outcome, Trial, run_trial

RANDOM = {
    "kind": "random",
    "duration": 1.6,
    "trials": 4,
    "pushes": {"magnitude": [0.05, 2.5], "unit": "ankle_fraction", "start": [0.1, 0.1]},
}
ENVELOPE = {
    "kind": "envelope",
    "duration": 1.6,
    "directions": 2,
    "start": 0.1,
    "impulses": [0.05, 1.2],
    "first_trials": 3,
    "trials": 2,
}


def write_suite(folder: Path, fields: dict[str, Any], name: str = "suite") -> Path:
    """A suite's file."""
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(fields))
    return path


class InProcess:
    """Plays like `Workers`, without processes; `played` counts trials, `stop_after` interrupts."""

    played = 0
    stop_after: int | None = None

    def __init__(
        self, controllers: Sequence[str], robot: str, overrides: dict[str, Any], count: int
    ):
        loaded = load_robot(robot)
        self.players = [load_player(name, loaded, **overrides) for name in controllers]

    def __enter__(self) -> InProcess:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def play(self, trials: Sequence[Trial]) -> Iterator[tuple[Trial, list[Outcome]]]:
        for trial in reversed(trials):  # any order must do
            if InProcess.stop_after is not None and InProcess.played >= InProcess.stop_after:
                raise KeyboardInterrupt
            InProcess.played += 1
            yield trial, [run_trial(player, trial) for player in self.players]
