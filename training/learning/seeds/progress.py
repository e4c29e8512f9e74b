"""Several training runs: how far each is, and what the terminal shows of them."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from poise.configs.errors import ConfigError
from poise.training.learning.config import TrainConfig
from poise.training.learning.policy_files import last_state
from poise.training.running.tables import text_table
from poise.training.running.terminal import steps_bar

from .records import SeedEntry, SeedSummary, evaluations, start_and_best

PERIOD = 1.0  # [s] between looks
BEFORE = "no checkpoint yet: compiling, evaluating the start, first updates"


@dataclass(frozen=True)
class SeedRun:
    """The run of one seed: what a process is given to do."""

    config: TrainConfig
    folder: Path

    def entry(self) -> SeedEntry:
        """How far it is, for seeds.json; raises ConfigError where its state cannot be read."""
        state = last_state(self.folder)
        start, best = start_and_best(state["evaluations"])
        return {
            "seed": self.config.seed,
            "folder": self.folder.name,
            "timesteps": state["timesteps"],
            "finished": state["timesteps"] >= self.config.steps,
            "start": start,
            "best": best,
        }


class SeedProgress:
    """A bar per run, of what the runs write to their folders; use as a context.

    So it is the same for processes of this machine and of others.
    """

    def __init__(self, runs: Sequence[SeedRun], console: Console):
        self.runs = runs
        self._bar = steps_bar("seed {task.fields[seed]}", console)
        self._tasks = [
            self._bar.add_task("", total=run.config.steps, seed=run.config.seed, rate=BEFORE)
            for run in runs
        ]
        self._end = threading.Event()
        self._watcher = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> SeedProgress:
        self._bar.start()
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._watcher.join()
        self._show()
        self._bar.stop()

    def _watch(self) -> None:
        while True:
            self._show()
            if self._end.wait(PERIOD):
                return

    def _show(self) -> None:
        for run, task in zip(self.runs, self._tasks, strict=True):
            try:
                entry = run.entry()
            except ConfigError:  # just being replaced
                continue
            start, best = entry["start"], entry["best"]
            text = f"held out, recovered {start['recovered']:.1%}" if start else ""
            text += f", best {best['recovered']:.1%}" if best and best is not start else ""
            steps = min(entry["timesteps"], run.config.steps)
            self._bar.update(task, completed=steps, rate=text)


def print_seeds(summary: SeedSummary, console: Console) -> None:
    """A row per seed, and the interquartile mean over them."""
    rows = (
        (str(entry["seed"]), f"{start['recovered']:.1%}", f"{best['recovered']:.1%}",
         f"{best['timesteps']:,.0f}", f"{best['fallen']:.1%}", f"{best['mean_abs_action']:.3f}")
        for entry in summary["runs"] for start, best in [evaluations(entry)]
    )  # fmt: skip
    headings = ("seed", "at the start", "best", "at step", "fell", "mean |action|")
    console.print(text_table("held-out pushes during training, recovered", (), headings, rows))
    found = summary["recovered"]
    low, high = found["iqm_ci95"]
    console.print(
        f"IQM over {len(summary['runs'])} seeds {found['iqm']:.1%} [{low:.1%}, {high:.1%}], "
        f"worst {found['worst']:.1%} (seed {found['worst_seed']})",
        highlight=False, markup=False,
    )  # fmt: skip
