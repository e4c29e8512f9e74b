"""Compute a controller's entry of summary.json."""

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np

from poise.training.benchmarking.diagnosis.words import losses
from poise.training.benchmarking.statistics.bootstrap import mean_over_directions
from poise.training.benchmarking.statistics.differences import ratio
from poise.training.benchmarking.statistics.eurobench import HUMAN_COM_HEIGHT
from poise.training.benchmarking.statistics.rates import eta
from poise.training.benchmarking.suites.plan import TrialPlan, at_level
from poise.training.benchmarking.suites.scenarios import PART as SCENARIOS
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import NStepLimit
from poise.training.benchmarking.trials.trial import counts_as_won as is_won
from poise.training.running.summary import (
    Direction,
    Entry,
    EnvelopeFigures,
    Fractions,
    RealismLevel,
    RobotFigures,
    Sector,
)
from poise.training.running.trial_figures import NOT_FALLEN, RECOVERED, ScenarioFigures

from .evaluated import (
    DIRECTIONAL,
    Evaluated,
    by_falls,
    cells,
    counts,
    fitted,
    fractions,
    limits_of_pushes,
    once,
    pushes,
    rated,
    sectors,
    trials_of_parts,
    won,
)
from .factors import eurobench_figures, factor_figures
from .lasting import gust_figures, sustained_figures
from .motions import in_motion, motion_levels
from .walking import phase_figures, walk_levels

RANDOM = ("random", "mix")  # parts that the rates of a level are of, where a suite has one


def controller_entry(
    evaluated: Evaluated, plan: TrialPlan, steps: NStepLimit | None = None
) -> Entry:
    """All figures of one controller; `steps` is the limit of one that steps."""
    everything, evaluated = evaluated, once(evaluated)
    entry: Entry = {
        **counts(rated(evaluated)),
        "criterion": NOT_FALLEN if by_falls(rated(evaluated)) else RECOVERED,
        "root_force_max": max((outcome.root_force or 0.0) for _, outcome in evaluated),
        "evaluated": len(everything),
        "errors": sum(outcome.error is not None for _, outcome in everything),
    }
    starts = [(t.push.start, o.fall_time) for t, o in everything if t.push is not None]
    if early := sum(fall is not None and fall < start for start, fall in starts):
        entry["fell_before_push"] = early
    stepping = any(outcome.steps for _, outcome in everything)
    if found := losses(((o, o.steps) for t, o in evaluated if not is_won(t, o)), stepping):
        entry["losses"] = found
    if directional := trials_of_parts(evaluated, *DIRECTIONAL):
        entry.update(envelope(directional, plan.limits, steps))
    if pushed := trials_of_parts(evaluated, "walk_push"):
        entry["phases"] = phase_figures(pushed, entry)
    if walks := walk_levels(evaluated, plan.suite.duration):
        entry["walks"] = walks
    if motions := motion_levels(evaluated):
        entry["motions"], entry["in_motion"] = motions, in_motion(evaluated)
    if scenarios := _scenarios(trials_of_parts(evaluated, SCENARIOS)):
        entry["scenarios"] = scenarios
    if sustained := trials_of_parts(evaluated, "sustained"):
        entry["sustained"] = sustained_figures(sustained, plan.limits.robot.mass)
    if gusts := trials_of_parts(evaluated, "gusts"):
        entry["gusts"] = gust_figures(gusts)
    if random := trials_of_parts(evaluated, "random"):
        entry.update(_fractions(random, plan.limits))
    if factors := factor_figures(trials_of_parts(evaluated, "factors"), plan.standard):
        entry["factors"] = factors
    if trials_of_parts(evaluated, "envelope", "margin"):
        entry["eurobench"] = eurobench_figures(evaluated, plan.limits)
    if plan.suite.levels:
        entry["levels"] = _levels(everything, plan.suite)
    return entry


def envelope(
    evaluated: Evaluated, limits: PushLimits, steps: NStepLimit | None = None
) -> EnvelopeFigures:
    """J50 [N·s], J90, η and the fraction of the limit of `steps` in each direction; their means."""
    direction, impulse, duration = pushes(evaluated)
    recovered, mass = won(evaluated), limits.robot.mass
    over_limit = impulse / limits_of_pushes(evaluated, limits)
    fit = mean_over_directions(direction, impulse, recovered)
    etas = mean_over_directions(direction, over_limit, recovered)
    ankle = [limits.ankle(angle, float(duration[0])) for angle in fit.directions]
    eta_values = eta([f.fit.j50 for f in fit.fits], mass, np.array(ankle) / mass)
    directions = [
        {
            "direction": angle,
            **fitted(f, "j50"),
            "j50_per_mass": f.fit.j50 / mass,
            "j90": f.fit.j90,
            "j90_ci95": f.j90_ci,
            "ankle_limit": limit,
            "eta": float(value),
            "eta_ci95": of_limit.j50_ci,
            "eta90": of_limit.fit.j90,
        }
        for angle, f, limit, value, of_limit in zip(
            fit.directions, fit.fits, ankle, eta_values, etas.fits, strict=True
        )
    ]
    figures: EnvelopeFigures = {
        "push_duration": float(duration[0]),
        "j50_mean": fit.j50_mean,
        "j50_mean_ci95": fit.j50_mean_ci,
        "j50_mean_bound": fit.mean_bound,
        "j50_mean_per_mass": fit.j50_mean / mass,
        "j50_min": min(f.fit.j50 for f in fit.fits),
        "j90_mean": float(np.mean([f.fit.j90 for f in fit.fits])),
        "j50_bounded": fit.bounded,
        "eta_mean": float(np.mean(eta_values)),
        "eta_mean_ci95": etas.j50_mean_ci,
        "eta_min": float(np.min(eta_values)),
        "directions": cast(list[Direction], directions),
    }
    if steps is not None:
        steps.add_to(figures, float(duration[0]))
    return figures


def _fractions(evaluated: Evaluated, limits: PushLimits) -> Fractions:
    together = mean_over_directions(np.zeros(len(evaluated)), fractions(evaluated), won(evaluated))
    (one,), by_sector = together.fits, sectors(evaluated)
    found = [
        {"direction": angle, **fitted(f, "fraction50")}
        for angle, f in zip(by_sector.directions, by_sector.fits, strict=True)
    ]
    return {
        "fraction_of": limits.scale,
        "fraction50": one.fit.j50,
        "fraction50_ci95": one.j50_ci,
        "fraction50_bound": one.fit.bound,
        "sectors": cast(list[Sector], found),
    }


def _scenarios(evaluated: Evaluated) -> list[ScenarioFigures]:
    """Return the figures of each scenario, in the order of the suite."""
    found: list[ScenarioFigures] = []
    for name, own in cells(evaluated, lambda trial: str(trial.level)).items():
        figures: ScenarioFigures = {"scenario": name, **counts(own)}
        if speeds := [o.speed_ahead for _, o in own if o.speed_ahead is not None]:
            figures["speed_ahead"] = sum(speeds) / len(speeds)
        found.append(figures)
    return found


def _levels(evaluated: Evaluated, suite: Suite) -> list[RealismLevel]:
    """Of the suite's own level, then of each of its `levels`; J50 also over that of the first."""

    def named(names: Sequence[str], level: str | None) -> Evaluated:
        return trials_of_parts(
            evaluated, *(n if level is None else at_level(n, level) for n in names)
        )

    found: list[RealismLevel] = []
    for level in (None, *suite.levels):
        every = named([name for name in suite.parts if name != "factors"], level)
        counted = counts(named(RANDOM, level) or every)
        here: RealismLevel = {
            "level": Path(level or suite.realism).stem,
            "trials": counted["trials"],
            "recovered": counted["recovered"],
            "recovered_rate": counted["recovered_rate"],
            "recovered_ci95": counted["recovered_ci95"],
            "fallen": counted["fallen"],
            "never_fell_rate": counted["never_fell_rate"],
            "never_fell_ci95": counted["never_fell_ci95"],
            "torque_variation_median": counted["torque_variation_median"],
            "energy_median": counted["energy_median"],
        }
        if quiet := named(["quiet"], level):
            stood = [outcome.upright for _, outcome in quiet]
            here["stood"], here["unpushed"] = sum(stood), len(stood)
        if aimed := named(DIRECTIONAL, level):
            direction, impulse, _ = pushes(aimed)
            fit = mean_over_directions(direction, impulse, won(aimed))
            here["j50_mean"], here["j50_mean_ci95"] = fit.j50_mean, fit.j50_mean_ci
            here["j50_mean_bound"], here["j50_bounded"] = fit.mean_bound, fit.bounded
            if found:
                first = found[0]["j50_mean"], found[0]["j50_mean_ci95"]
                kept = ratio(*first, fit.j50_mean, fit.j50_mean_ci)
                if found[0]["j50_mean_bound"] or fit.mean_bound:
                    kept = None, None  # a bound over a value is no estimate
                here["j50_kept"], here["j50_kept_ci95"] = kept
        found.append(here)
    return found


def robot_figures(limits: PushLimits) -> RobotFigures:
    """Return the robot's figures that a report needs."""
    robot = limits.robot
    return {
        "name": robot.name,
        "mass": robot.mass,
        "height_com": robot.height_com,
        "omega": robot.omega,
        "human_com_height": HUMAN_COM_HEIGHT,
        "ankle_limit": [(float(a), limits.ankle(float(a), 0.1)) for a in limits.around(5.0)],
    }
