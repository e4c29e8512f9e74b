"""Figures of trials that walk: falls per minute, how exact, at what cost; J50 by phase."""

from typing import cast

import numpy as np

from poise.training.benchmarking.statistics.bootstrap import mean_over_directions
from poise.training.benchmarking.statistics.rates import mean_or_none, poisson_interval
from poise.training.benchmarking.suites.walking import WALKING
from poise.training.running.summary import EnvelopeFigures
from poise.training.running.trial_figures import PhaseJ50, StepsAsCommanded, WalkLevel, WalkMeans

from .evaluated import Evaluated, cells, met_by_all, rate, trials_of_parts, won

PHASES = 8  # of a stride
STEP_TOLERANCE = 0.1  # largest error of a step parameter as commanded, as a fraction
#: figures of a trial that are averaged over a level
MEANS = tuple(WalkMeans.__annotations__)


def walk_levels(evaluated: Evaluated, duration: float) -> list[WalkLevel]:
    """Return the levels of the parts that walk, in the order of the suite; trials last `duration`
    [s].

    Of pushes whose J50 is measured, only the first stage, common to all controllers.
    """
    walked = met_by_all(trials_of_parts(evaluated, *WALKING))
    found = cells(walked, lambda trial: (trial.part, str(trial.level)))
    return [_level(*key, own, duration) for key, own in found.items()]


def _level(name: str, text: str, evaluated: Evaluated, duration: float) -> WalkLevel:
    outcomes = [outcome for _, outcome in evaluated]
    fallen = sum(outcome.fallen for outcome in outcomes)
    walked = [each for each in outcomes if each.error is None]
    times = [duration if each.fall_time is None else each.fall_time for each in walked]
    minutes = sum(times) / 60.0
    low, high = poisson_interval(fallen)
    means = {key: mean_or_none([getattr(each, key) for each in outcomes]) for key in MEANS}
    steps: StepsAsCommanded = {}
    if name == "gait":
        kept = [each.upright and (each.step_error or 0.0) <= STEP_TOLERANCE for each in outcomes]
        steps = {"steps_as_commanded_rate": sum(kept) / len(kept)}
    return {
        "part": name,
        "level": text,
        **rate(evaluated),
        "minutes": minutes,
        "falls_per_minute": fallen / minutes if minutes else None,
        "falls_per_minute_ci95": (low / minutes, high / minutes) if minutes else None,
        **steps,
        **cast(WalkMeans, means),
    }


def phase_figures(evaluated: Evaluated, envelope: EnvelopeFigures) -> list[PhaseJ50]:
    """J50 [N·s] in each of 8 phases of the stride, over all directions.

    Impulses are measured by the J50 of their direction; the fraction of it that half of the pushes
    of a phase do not make it fall at, times the mean J50, is the phase's. Trials whose phase is not
    known, because the robot had not walked long enough, are left out.
    """
    j50 = {entry["direction"]: entry["j50"] for entry in envelope["directions"]}
    phase, fraction, upright = [], [], []
    for (trial, outcome), held in zip(evaluated, won(evaluated), strict=True):
        if outcome.push_phase is not None and trial.push is not None and j50[trial.push.direction]:
            phase.append(np.floor(PHASES * outcome.push_phase) % PHASES)
            fraction.append(trial.push.impulse / j50[trial.push.direction])
            upright.append(held)
    if not phase:
        return []
    fit, mean = mean_over_directions(phase, fraction, upright), envelope["j50_mean"]
    return [
        {
            "phase": (k + 0.5) / PHASES,
            "trials": f.fit.trials,
            "recovered": f.fit.recovered,
            "j50": mean * f.fit.j50,
            "j50_ci95": (mean * f.j50_ci.low, mean * f.j50_ci.high),
            "j50_bound": f.fit.bound,
        }
        for k, f in zip(fit.directions, fit.fits, strict=True)
    ]
