"""Evaluated trials of one controller with their outcomes, as arrays and in parts."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from poise.training.benchmarking.statistics.bootstrap import (
    DirectionFit,
    EnvelopeFit,
    mean_over_directions,
)
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.suites.plan import LEVEL
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.benchmarking.trials.trial import counts_as_won as is_won
from poise.training.running.trial_figures import Counts, Rate, RisingFigures

Key = TypeVar("Key")
Evaluated = Sequence[tuple[Trial, Outcome]]  # of one controller, ordered by number
RATED = ("mix", "motions")  # parts that the counts are of, where a suite has one
WALK_PUSH = "walk_push"
DIRECTIONAL = ("envelope", "grid", WALK_PUSH)  # parts that J50 of each direction is fitted to
SECTOR = 45.0  # [deg] in which random directions are counted together


def trials_of_parts(evaluated: Evaluated, *names: str) -> Evaluated:
    """Return the trials of some parts."""
    return [(trial, outcome) for trial, outcome in evaluated if trial.part in names]


def once(evaluated: Evaluated) -> Evaluated:
    """Return the trials without those repeated at another realism level."""
    return [(trial, outcome) for trial, outcome in evaluated if LEVEL not in trial.part]


def rated(evaluated: Evaluated) -> Evaluated:
    """Return the rated trials: those of the random suite `mix`, else all at the suite's own level.

    Of pushed walks only the first stage counts: the second is harder for better controllers.
    """
    return trials_of_parts(evaluated, *RATED) or met_by_all(once(evaluated))


def met_by_all(evaluated: Evaluated) -> Evaluated:
    """Return the trials without the second stage of pushed walks, whose pushes a controller
    chose."""
    return [(trial, outcome) for trial, outcome in evaluated
            if trial.part != WALK_PUSH or trial.stage == 1]  # fmt: skip


def by_falls(evaluated: Evaluated) -> bool:
    """Return whether all of these trials are judged by falls, see `Trial.judged_by_falls`."""
    return bool(evaluated) and all(trial.judged_by_falls for trial, _ in evaluated)


def cells(
    evaluated: Evaluated, key: Callable[[Trial], Key]
) -> dict[Key, list[tuple[Trial, Outcome]]]:
    """Return the trials grouped by `key`, in order of first appearance."""
    found: dict[Key, list[tuple[Trial, Outcome]]] = {}
    for trial, outcome in evaluated:
        found.setdefault(key(trial), []).append((trial, outcome))
    return found


def pushes(evaluated: Evaluated) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direction [deg], impulse [N·s] and duration [s] of every trial's push."""
    found = [(t.push.direction, t.push.impulse, t.push.duration) for t, _ in evaluated if t.push]
    direction, impulse, duration = np.array(found).reshape(-1, 3).T
    return direction, impulse, duration


def won(evaluated: Evaluated) -> np.ndarray:
    """Return an array (n,), true where a trial was won: recovered, or of a walk not fallen."""
    return np.array([is_won(trial, outcome) for trial, outcome in evaluated], dtype=bool)


def fractions(evaluated: Evaluated) -> np.ndarray:
    """Impulse over the limit of every trial."""
    return np.array([trial.limit_fraction for trial, _ in evaluated], dtype=float)


def sectors(evaluated: Evaluated) -> EnvelopeFit:
    """Return fits of the fraction of the limit in sectors of 45°, named by their middle."""
    direction, _, _ = pushes(evaluated)
    middle = SECTOR * (np.rint(direction / SECTOR) % (360.0 / SECTOR))
    return mean_over_directions(middle, fractions(evaluated), won(evaluated))


def fitted(one: DirectionFit, name: str) -> dict[str, Any]:
    """What half of some trials recover, by this name, with its interval and what it is a bound of,
    and how many they are."""
    return {
        "trials": one.fit.trials,
        "recovered": one.fit.recovered,
        name: one.fit.j50,
        f"{name}_ci95": one.j50_ci,
        f"{name}_bound": one.fit.bound,
    }


def rate(evaluated: Evaluated) -> Rate:
    """Return the counts of recovered and of fallen trials, and their rates, with intervals."""
    trials = len(evaluated)
    recovered = sum(outcome.recovered for _, outcome in evaluated)
    upright = sum(outcome.upright for _, outcome in evaluated)
    return {
        "trials": trials,
        "recovered": recovered,
        "recovered_rate": recovered / trials,
        "recovered_ci95": wilson_interval(recovered, trials),
        "fallen": sum(outcome.fallen for _, outcome in evaluated),
        "never_fell_rate": upright / trials,
        "never_fell_ci95": wilson_interval(upright, trials),
    }


def counts(evaluated: Evaluated) -> Counts:
    """Return counts of outcomes, and medians of figures, some of them of won trials only."""
    outcomes = [outcome for _, outcome in evaluated]
    standing = [outcome for trial, outcome in evaluated if is_won(trial, outcome)]
    unpushed = [outcome for outcome in outcomes if outcome.com_drift is not None]

    def over(
        name: str, function: Callable[[list[float]], float], chosen: Sequence[Outcome] = outcomes
    ) -> float | None:
        values = [getattr(outcome, name) for outcome in chosen]
        values = [value for value in values if value is not None]
        return float(function(values)) if values else None

    return {
        **rate(evaluated),
        "recovered_with_step": sum(outcome.foot_displaced for outcome in standing),
        "recovered_in_place": sum(o.steps == 0 and not o.foot_displaced for o in standing),
        "steps_mean": over("steps", np.mean),
        "steps_max": over("steps", np.max),
        "solver_failures": sum(outcome.solver_failures for outcome in outcomes),
        "solver_failures_recovered": sum(outcome.solver_failures for outcome in standing),
        "recovery_time_median": over("recovery_time", np.median),
        "max_com_median": over("max_com", np.median, standing),
        "max_capture_median": over("max_capture", np.median, standing),
        "min_cop_margin_median": over("min_cop_margin", np.median, standing),
        "max_slide": over("max_slide", np.max, standing),
        "energy_median": over("energy", np.median, standing),
        "mean_power_median": over("mean_power", np.median, standing),
        "torque_variation_median": over("torque_variation", np.median, standing),
        "peak_torque_median": over("peak_torque", np.median),
        "mean_abs_action": over("mean_abs_action", np.mean),
        "mean_abs_action_max": over("mean_abs_action", np.max),
        **rising(outcomes),
        "com_drift_max": over("com_drift", np.max),
        "foot_drift_max": over("foot_drift", np.max),
        "unpushed_lean_max": over("final_lean", np.max, unpushed),
    }


def rising(outcomes: Sequence[Outcome]) -> RisingFigures:
    """Of the robots that were down and watched, the fraction that was up again, and when."""
    watched = [outcome for outcome in outcomes if outcome.up_again is not None]
    if not watched:
        return {}
    up = sum(bool(outcome.up_again) for outcome in watched)
    times = [each.up_time for each in watched if each.up_time is not None]
    return {
        "downs": len(watched),
        "up_again_rate": up / len(watched),
        "up_again_ci95": wilson_interval(up, len(watched)),
        "up_time_median": float(np.median(times)) if times else None,
    }


def limits_of_pushes(evaluated: Evaluated, limits: PushLimits) -> np.ndarray:
    """Return the ankle limit [N·s] for the push of every trial."""
    direction, _, duration = pushes(evaluated)
    return np.array([limits.ankle(d, t) for d, t in zip(direction, duration, strict=True)])


def lost(evaluated: Evaluated) -> list[int]:
    """Return the sorted numbers of the trials at the suite's own level that were lost."""
    return [trial.number for trial, outcome in once(evaluated) if not is_won(trial, outcome)]
