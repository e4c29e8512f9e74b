"""Figures of pushes that last, and of gusts: which force is held, how many pushes are survived."""

import numpy as np

from poise.training.benchmarking.statistics.bootstrap import mean_over_directions
from poise.training.benchmarking.statistics.rates import percentile_interval
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.trial_figures import GustFigures, SustainedFigures

from .played import Played, counts

ALL = "all"
RESAMPLES = 2000


def held(outcome: Outcome) -> bool:
    """Whether the robot did not fall."""
    return not outcome.fallen and outcome.error is None


def sustained_figures(played: Played, mass: float) -> list[SustainedFigures]:
    """Of all pushes, then of each profile.

    F50 [N] is the largest force of a push that half of the trials hold, without a fall: fitted
    over that force as J50 is over the impulse.
    """
    profiles = dict.fromkeys(str(trial.level) for trial, _ in played)
    groups = {ALL: played} | {
        name: [each for each in played if each[0].level == name] for name in profiles
    }
    found: list[SustainedFigures] = []
    for name, own in groups.items():
        force = [trial.pushes[0].peak_force for trial, _ in own]
        stood = [held(outcome) for _, outcome in own]
        (fitted,) = mean_over_directions(np.zeros(len(own)), force, stood).fits
        found.append(
            {
                "profile": name,
                **counts(own),
                "f50": fitted.fit.j50,
                "f50_ci95": fitted.j50_ci,
                "f50_bound": fitted.fit.bound,
                "f50_per_mass": fitted.fit.j50 / mass,
            }
        )
    return found


def survived(trial: Trial, outcome: Outcome) -> int:
    """The number of pushes after which the robot still stood: until the next one, or the end."""
    if held(outcome):
        return len(trial.pushes)
    if outcome.fall_time is None:  # the controller raised
        return 0
    later = [push.start for push in trial.pushes[1:]]
    return sum(start <= outcome.fall_time for start in later)


def gust_figures(played: Played) -> GustFigures:
    """The counts, and the mean number of pushes survived with its bootstrap interval."""
    numbers = np.array([survived(trial, outcome) for trial, outcome in played], dtype=float)
    rng = np.random.default_rng(0)
    drawn = rng.choice(numbers, (RESAMPLES, len(numbers))).mean(axis=1)
    return {
        **counts(played),
        "pushes": max(len(trial.pushes) for trial, _ in played),
        "survived_mean": float(numbers.mean()),
        "survived_ci95": percentile_interval(drawn, (len(numbers), 1)),
        "first_survived": int((numbers >= 1.0).sum()),
    }
