"""Trials of one controller with their outcomes, as arrays and in parts."""

from collections.abc import Sequence

import numpy as np

from poise.training.benchmarking.statistics.bootstrap import EnvelopeFit, mean_over_directions
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.suites.plan import LEVEL
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.summary import Rate

Played = Sequence[tuple[Trial, Outcome]]  # by one controller, in the order of the numbers
RATED = ("mix", "motions")  # parts that the counts are of, where a suite has one
DIRECTIONAL = ("envelope", "grid", "walk_push")  # parts that J50 of each direction is fitted to
SECTOR = 45.0  # [deg] in which random directions are counted together


def part(played: Played, *names: str) -> Played:
    """The trials of some parts."""
    return [(trial, outcome) for trial, outcome in played if trial.part in names]


def once(played: Played) -> Played:
    """The trials without those that are played again at a level of realism."""
    return [(trial, outcome) for trial, outcome in played if LEVEL not in trial.part]


def rated(played: Played) -> Played:
    """The trials that a controller is rated by: those of the mix, else all that is played once."""
    return part(played, *RATED) or once(played)


def pushes(played: Played) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direction [deg], impulse [N·s] and duration [s] of every trial's push."""
    found = [(t.push.direction, t.push.impulse, t.push.duration) for t, _ in played if t.push]
    direction, impulse, duration = np.array(found).reshape(-1, 3).T
    return direction, impulse, duration


def won(played: Played) -> np.ndarray:
    """An array (n,), true where a trial was recovered."""
    return np.array([outcome.recovered for _, outcome in played], dtype=bool)


def fractions(played: Played) -> np.ndarray:
    """Impulse over the limit of every trial."""
    return np.array([trial.limit_fraction for trial, _ in played], dtype=float)


def sectors(played: Played) -> EnvelopeFit:
    """Fits of the fraction of the limit in sectors of 45°, named by their middle."""
    direction, _, _ = pushes(played)
    middle = SECTOR * (np.rint(direction / SECTOR) % (360.0 / SECTOR))
    return mean_over_directions(middle, fractions(played), won(played))


def rate(recovered: Sequence[bool]) -> Rate:
    """The count of recovered trials and their rate, with its interval."""
    trials, count = len(recovered), int(sum(recovered))
    return {
        "trials": trials,
        "recovered": count,
        "recovered_rate": count / trials,
        "recovered_ci95": wilson_interval(count, trials),
    }


def ankle_limits(played: Played, limits: PushLimits) -> np.ndarray:
    """The ankle limit [N·s] for the push of every trial."""
    direction, _, duration = pushes(played)
    return np.array([limits.ankle(d, t) for d, t in zip(direction, duration, strict=True)])


def lost(played: Played) -> list[int]:
    """The numbers of the trials of the suite's own level that were not recovered, rising: those
    whose causes are counted."""
    return [trial.number for trial, outcome in once(played) if not outcome.recovered]
