"""Playing one trial of a result again, exactly, from its folder."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from poise.baselines.allowance import allowing
from poise.envs.balance.base import BalanceEnv
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.signals import Signals
from poise.training.benchmarking.trials.table import outcome_cells
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.files import SETTINGS

from .film import film
from .player import player
from .read import Results, load_results


@dataclass(frozen=True)
class Replay:
    """A trial played again.

    Attributes:
        trial: the trial.
        controller: who played it.
        outcome: of now.
        differences: column of trials.csv → (recorded, now), for those that differ.
    """

    trial: Trial
    controller: str
    outcome: Outcome
    differences: dict[str, tuple[str, str]]


def replay(
    folder: str | Path | Results,
    trial: int,
    controller: str | None = None,
    *,
    video: str | Path | None = None,
    plot: str | Path | None = None,
    watch: Callable[[BalanceEnv], object] | None = None,
    allow: str | Iterable[str] = (),
) -> Replay:
    """Play a trial of a result again and compare it with what was recorded.

    Args:
        folder: written by `evaluate` or `benchmark`, or what `load_results` has read there.
        trial: its number in trials.csv.
        controller: one that took part; None: the last, which is the first if it is alone.
        video: an MP4 or WebP file to write, see `film`.
        plot: a PNG file to write: CoM, CoP, capture point and torque over time.
        watch: called with the environment after the reset and after every step.
        allow: controllers from outside (``module:Class``) that may run.

    Raises:
        ConfigError: no finished result there, no such trial or controller, or a controller or
            robot that is no longer the one that took part, or may not run.
        PoiseError: nothing can be drawn here, or a file cannot be written.
    """
    path = folder.folder if isinstance(folder, Results) else Path(folder)
    with allowing(allow, source=path / SETTINGS):
        results = folder if isinstance(folder, Results) else load_results(path)
        name = results.controllers[-1] if controller is None else controller
        record = results.record(name, trial)
        again = results.trial(record)
        agent = player(results, name, again)
    signals = Signals() if plot is not None else None
    watches = [each for each in (signals, watch) if each is not None]
    outcome = run_trial(agent, again, lambda env: [each(env) for each in watches])
    differences = {
        key: (record.line[key], text)
        for key, value in outcome_cells(outcome).items()
        if record.line.get(key, "") != (text := "" if value is None else str(value))
        and key in record.line  # older results say less
    }
    if plot is not None and signals is not None:
        _draw(signals, Path(plot), again, f"Trial {trial}, {name}")
    if video is not None:
        film(results, trial, [name], video, allow=allow)
    return Replay(again, name, outcome, differences)


def _draw(signals: Signals, path: Path, trial: Trial, title: str) -> None:
    from poise.training.pictures.figures.time_series import trial_timeseries

    pushes = [(push.start, push.duration) for push in trial.pushes]
    trial_timeseries(path, signals.t, signals.columns, pushes=pushes, title=title)
