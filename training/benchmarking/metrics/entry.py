"""A controller's entry of summary.json is computed here."""

from collections.abc import Callable, Sequence

import numpy as np

from poise.training.benchmarking.diagnosis.words import losses
from poise.training.benchmarking.statistics.bootstrap import mean_over_directions
from poise.training.benchmarking.statistics.eurobench import HUMAN_COM_HEIGHT
from poise.training.benchmarking.statistics.fits import fit_logistic
from poise.training.benchmarking.statistics.rates import eta, wilson_interval
from poise.training.benchmarking.suites.plan import Plan
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import NStepLimit
from poise.training.benchmarking.trials.trial import Outcome
from poise.training.running.summary import (
    Counts,
    Direction,
    Entry,
    EnvelopeFigures,
    Fractions,
    RobotFigures,
    Sector,
)

from .factors import eurobench_figures, factor_figures
from .levels import level_figures
from .motions import in_motion, motion_levels
from .played import (
    DIRECTIONAL,
    Played,
    ankle_limits,
    fractions,
    once,
    part,
    pushes,
    rate,
    rated,
    sectors,
    won,
)
from .scenarios import scenario_figures
from .walking import phase_figures, walk_levels


def controller_entry(played: Played, plan: Plan, steps: NStepLimit | None = None) -> Entry:
    """All figures of one controller; `steps` is the limit of one that steps."""
    everything, played = played, once(played)
    entry: Entry = {
        **counts([outcome for _, outcome in rated(played)]),
        "root_force_max": max((outcome.root_force or 0.0) for _, outcome in played),
        "played": len(everything),
        "errors": sum(outcome.error is not None for _, outcome in everything),
    }
    if found := losses((outcome, outcome.steps) for _, outcome in played):
        entry["losses"] = found
    if directional := part(played, *DIRECTIONAL):
        entry.update(envelope(directional, plan.limits, steps))
    if pushed := part(played, "walk_push"):
        entry["phases"] = phase_figures(pushed, entry)
    if walks := walk_levels(played, plan.suite.duration):
        entry["walks"] = walks
    if motions := motion_levels(played):
        entry["motions"], entry["in_motion"] = motions, in_motion(played)
    if scenarios := scenario_figures(played, counts):
        entry["scenarios"] = scenarios
    if random := part(played, "random"):
        entry.update(_fractions(random, plan.limits))
    if factors := factor_figures(part(played, "factors"), plan.standard):
        entry["factors"] = factors
    if part(played, "envelope", "margin"):
        entry["eurobench"] = eurobench_figures(played, plan.limits)
    if plan.suite.levels:
        entry["levels"] = level_figures(everything, plan.suite, counts)
    return entry


def counts(outcomes: Sequence[Outcome]) -> Counts:
    """Counts of how trials ended, and medians of what was recorded."""
    standing = [outcome for outcome in outcomes if outcome.recovered]
    unpushed = [outcome for outcome in outcomes if outcome.com_drift is not None]
    trials, fallen = len(outcomes), sum(outcome.fallen for outcome in outcomes)
    stood = sum(not outcome.fallen and outcome.error is None for outcome in outcomes)

    def over(
        name: str, function: Callable[[list[float]], float], chosen: Sequence[Outcome] = outcomes
    ) -> float | None:
        values = [getattr(outcome, name) for outcome in chosen]
        values = [value for value in values if value is not None]
        return float(function(values)) if values else None

    return {
        **rate([outcome.recovered for outcome in outcomes]),
        "fallen": fallen,
        "never_fell_rate": stood / trials,
        "never_fell_ci95": wilson_interval(stood, trials),
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
        "com_drift_max": over("com_drift", np.max),
        "foot_drift_max": over("foot_drift", np.max),
        "unpushed_lean_max": over("final_lean", np.max, unpushed),
    }


def envelope(
    played: Played, limits: PushLimits, steps: NStepLimit | None = None
) -> EnvelopeFigures:
    """J50 [N·s], J90, η and the fraction of the limit of `steps` in each direction; their means."""
    direction, impulse, duration = pushes(played)
    recovered, mass = won(played), limits.robot.mass
    over_limit = impulse / ankle_limits(played, limits)
    fit = mean_over_directions(direction, impulse, recovered)
    etas = mean_over_directions(direction, over_limit, recovered)
    ankle = [limits.ankle(angle, float(duration[0])) for angle in fit.directions]
    eta_values = eta([f.fit.j50 for f in fit.fits], mass, np.array(ankle) / mass)
    directions: list[Direction] = [
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
        "j50_mean_per_mass": fit.j50_mean / mass,
        "j50_min": min(f.fit.j50 for f in fit.fits),
        "j90_mean": float(np.mean([f.fit.j90 for f in fit.fits])),
        "j50_bounded": fit.bounded,
        "eta_mean": float(np.mean(eta_values)),
        "eta_mean_ci95": etas.j50_mean_ci,
        "eta_min": float(np.min(eta_values)),
        "directions": directions,
    }
    if steps is not None:
        steps.add_to(figures, float(duration[0]))
    return figures


def _fractions(played: Played, limits: PushLimits) -> Fractions:
    fit, by_sector = fit_logistic(fractions(played), won(played)), sectors(played)
    found: list[Sector] = [
        {
            "direction": angle,
            "trials": f.fit.trials,
            "recovered": f.fit.recovered,
            "fraction50": f.fit.j50,
            "fraction50_ci95": f.j50_ci,
            "fraction50_bound": f.fit.bound,
        }
        for angle, f in zip(by_sector.directions, by_sector.fits, strict=True)
    ]
    return {
        "fraction_of": limits.scale,
        "fraction50": fit.j50,
        "fraction50_bound": fit.bound,
        "sectors": found,
    }


def robot_figures(limits: PushLimits) -> RobotFigures:
    """The robot's figures that a report needs."""
    robot = limits.robot
    return {
        "name": robot.name,
        "mass": robot.mass,
        "height_com": robot.height_com,
        "omega": robot.omega,
        "human_com_height": HUMAN_COM_HEIGHT,
        "ankle_limit": [(float(a), limits.ankle(float(a), 0.1)) for a in limits.around(5.0)],
    }
