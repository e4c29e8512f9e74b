"""How far the trials of a performance have come, in a terminal or as lines."""

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from rich.console import Console
from rich.progress import TaskID

from poise.envs.balance.base import BalanceEnv
from poise.training.benchmarking.trials.play import Watch
from poise.training.benchmarking.trials.trial import Trial
from poise.training.running.terminal import trials_bar

EVERY = 0.5  # [s] of the simulation


class FollowProgress(ExitStack):
    """A bar of trials, with the seconds of each; use as a context, and as the `watch` of `follow`.

    Args:
        starts: number of trials.
        console: where it is shown.
        others: another watch that is also called for every trial.
        filmed: whether that films the first trial, which takes longer than the others.
    """

    def __init__(
        self, starts: int, console: Console,
        others: Callable[[Trial], Watch | None] | None = None, filmed: bool = False,
    ):  # fmt: skip
        super().__init__()
        self.starts, self.others, self.filmed = starts, others, filmed
        self._bar = trials_bar(console)
        self._task: TaskID | None = None  # none until the first trial: what fails before is alone

    def __exit__(self, *error: Any) -> bool | None:
        if error == (None, None, None) and self._task is not None:
            self._bar.update(self._task, completed=self.starts)
        return super().__exit__(*error)

    def __call__(self, trial: Trial) -> Watch:
        """What watches a trial."""
        if self._task is None:
            self.enter_context(self._bar)
            self._task = self._bar.add_task("", total=self.starts, rate="")
        task, more = self._task, None if self.others is None else self.others(trial)
        shown, filmed = -EVERY, ", filmed" if self.filmed and trial.number == 0 else ""

        def watch(env: BalanceEnv) -> None:
            nonlocal shown
            if more is not None:
                more(env)
            time = env.simulation.time
            if time >= shown + EVERY:
                shown = time
                rate = f"trial {trial.number + 1}{filmed}: {time:.0f} s"
                self._bar.update(task, completed=trial.number, rate=rate)

        return watch
