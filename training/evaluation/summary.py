"""What an evaluation found: summary.json as plain dictionaries."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from poise.training.statistics.bootstrap import EnvelopeFit, j50_gain, mean_over_directions
from poise.training.statistics.fits import fit_logistic
from poise.training.statistics.rates import eta, mcnemar, wilson_interval
from poise.training.suites.base import Suite
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.step_limits import NStepLimit, curves
from poise.training.trials.trial import Outcome, Trial

Outcomes = Mapping[str, Sequence[Outcome]]  # controller → outcome of each trial
SECTOR = 45.0  # [deg] in which random directions are counted together


def summarise(
    suite: Suite,
    trials: Sequence[Trial],
    outcomes: Outcomes,
    limits: PushLimits,
    steps: Mapping[str, NStepLimit] | None = None,
) -> dict[str, Any]:
    """The figures of every controller and every pair.

    Suites by direction give J50 [N·s], J90, η and, of controllers that have one in `steps`, the
    share of the N-step limits; others with pushes give `fraction50`, the share of the limit at
    which half of the trials are recovered, over all and in sectors of 45°.
    """
    steps = steps or {}
    controllers = {}
    for name, results in outcomes.items():
        entry = counts(results)
        if suite.by_direction:
            entry |= envelope(trials, results, limits, steps.get(name))
        elif trials[0].push is not None and not trials[0].later:
            entry |= _fractions(trials, results, limits)
        controllers[name] = entry
    pairs = [
        _pair(a, b, suite, trials, outcomes[a], outcomes[b]) for a, b in combinations(outcomes, 2)
    ]
    figures = {"controllers": controllers, "pairs": pairs}
    if suite.by_direction and steps:
        figures["step_limits"] = curves(steps, float(pushes(trials)[2][0]))
    return figures


def pushes(trials: Sequence[Trial]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direction [deg], impulse [N·s] and duration [s] of every trial's push."""
    found = [(t.push.direction, t.push.impulse, t.push.duration) for t in trials if t.push]
    return tuple(np.array(found).reshape(-1, 3).T)  # type: ignore[return-value]


def won(results: Sequence[Outcome]) -> np.ndarray:
    """Whether each trial was recovered."""
    return np.array([outcome.recovered for outcome in results], dtype=bool)


def fractions(trials: Sequence[Trial]) -> np.ndarray:
    """Impulse over the limit of every trial."""
    return np.array([trial.limit_fraction for trial in trials], dtype=float)


def sectors(trials: Sequence[Trial], results: Sequence[Outcome]) -> EnvelopeFit:
    """Fits of the share of the limit in sectors of 45°, named by their middle."""
    direction, _, _ = pushes(trials)
    middle = SECTOR * (np.rint(direction / SECTOR) % (360.0 / SECTOR))
    return mean_over_directions(middle, fractions(trials), won(results))


def counts(results: Sequence[Outcome]) -> dict[str, Any]:
    """How many were recovered, how, and medians of what was recorded."""
    recovered = won(results)
    trials, count = len(results), int(recovered.sum())

    def over(name: str, function: Any, chosen: Sequence[Outcome] = results) -> float | None:
        values = [getattr(outcome, name) for outcome in chosen]
        values = [value for value in values if value is not None]
        return float(function(values)) if values else None

    standing = [outcome for outcome in results if outcome.recovered]
    fallen = sum(outcome.fallen for outcome in results)
    return {
        "trials": trials,
        "recovered": count,
        "recovered_rate": count / trials,
        "recovered_ci95": wilson_interval(count, trials),
        "fallen": fallen,
        "never_fell_rate": 1.0 - fallen / trials,
        "never_fell_ci95": wilson_interval(trials - fallen, trials),
        "recovered_with_step": sum(outcome.stepped for outcome in standing),
        "recovered_in_place": sum(o.steps == 0 and not o.stepped for o in standing),
        "steps_mean": over("steps", np.mean),
        "steps_max": over("steps", np.max),
        "solver_failures": sum(outcome.solver_failures for outcome in results),
        "recovery_time_median": over("recovery_time", np.median),
        "max_com_median": over("max_com", np.median, standing),
        "max_capture_median": over("max_capture", np.median, standing),
        "min_cop_margin_median": over("min_cop_margin", np.median, standing),
        "max_slide": over("max_slide", np.max, standing),
        "energy_median": over("energy", np.median, standing),
        "peak_torque_median": over("peak_torque", np.median),
        "mean_abs_action": over("mean_abs_action", np.mean),
        "mean_abs_action_max": over("mean_abs_action", np.max),
        "com_drift_max": over("com_drift", np.max),
        "root_force_max": over("root_force", np.max),
    }


def envelope(
    trials: Sequence[Trial],
    results: Sequence[Outcome],
    limits: PushLimits,
    steps: NStepLimit | None = None,
) -> dict[str, Any]:
    """J50 [N·s], J90, η and the share of the limit of `steps` in each direction; their means."""
    direction, impulse, duration = pushes(trials)
    fit = mean_over_directions(direction, impulse, won(results))
    ankle = [limits.ankle(angle, float(duration[0])) for angle in fit.directions]
    mass = limits.robot.mass
    etas = eta([f.fit.j50 for f in fit.fits], mass, np.array(ankle) / mass)
    figures = {
        "j50_mean": fit.j50_mean,
        "j50_mean_ci95": fit.j50_mean_ci,
        "j50_mean_per_mass": fit.j50_mean / mass,
        "j50_min": min(f.fit.j50 for f in fit.fits),
        "j90_mean": float(np.mean([f.fit.j90 for f in fit.fits])),
        "j50_bounded": fit.bounded,
        "eta_mean": float(np.mean(etas)),
        "eta_min": float(np.min(etas)),
        "directions": [
            {
                "direction": angle,
                "trials": f.fit.trials,
                "recovered": f.fit.recovered,
                "j50": f.fit.j50,
                "j50_ci95": f.j50_ci,
                "j50_bound": f.fit.bound,
                "j50_per_mass": f.fit.j50 / mass,
                "j90": f.fit.j90,
                "j90_ci95": f.j90_ci,
                "ankle_limit": limit,
                "eta": float(value),
            }
            for angle, f, limit, value in zip(fit.directions, fit.fits, ankle, etas, strict=True)
        ],
    }
    if steps is not None:
        steps.add_to(figures, float(duration[0]))
    return figures


def _fractions(
    trials: Sequence[Trial], results: Sequence[Outcome], limits: PushLimits
) -> dict[str, Any]:
    fit = fit_logistic(fractions(trials), won(results))
    by_sector = sectors(trials, results)
    return {
        "fraction_of": limits.scale,
        "fraction50": fit.j50,
        "fraction50_bound": fit.bound,
        "sectors": [
            {
                "direction": angle,
                "trials": f.fit.trials,
                "recovered": f.fit.recovered,
                "fraction50": f.fit.j50,
                "fraction50_ci95": f.j50_ci,
                "fraction50_bound": f.fit.bound,
            }
            for angle, f in zip(by_sector.directions, by_sector.fits, strict=True)
        ],
    }


def _pair(
    a: str,
    b: str,
    suite: Suite,
    trials: Sequence[Trial],
    results_a: Sequence[Outcome],
    results_b: Sequence[Outcome],
) -> dict[str, Any]:
    """b against a: counts, McNemar's test, and the relative gain of b's J50 over a's."""
    won_a, won_b = won(results_a), won(results_b)
    only_a, only_b = int((won_a & ~won_b).sum()), int((won_b & ~won_a).sum())
    pair: dict[str, Any] = {
        "a": a,
        "b": b,
        "both": int((won_a & won_b).sum()),
        "only_a": only_a,
        "only_b": only_b,
        "neither": int((~won_a & ~won_b).sum()),
        "p_mcnemar": mcnemar(only_a, only_b).p_value,
        "rate_gain": (only_b - only_a) / len(trials),
        "lost_rate": only_a / len(trials),
        "identical": list(results_a) == list(results_b),
    }
    if suite.by_direction:
        direction, impulse, _ = pushes(trials)
        gain = j50_gain(direction, impulse, won_a, won_b)
        pair["j50_gain"] = gain.mean.relative
        pair["j50_gain_ci95"] = gain.mean.relative_ci
        pair["directions"] = [
            {"direction": angle, "j50_gain": g.relative, "j50_gain_ci95": g.relative_ci}
            for angle, g in zip(gain.directions, gain.gains, strict=True)
        ]
    return pair
