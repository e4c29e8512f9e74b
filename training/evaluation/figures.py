"""What a controller reached: its entry of summary.json."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from poise.training.running.summary import (
    Counts,
    Direction,
    Entry,
    Envelope,
    Eurobench,
    Factor,
    Fractions,
    Level,
    Margin,
    Rate,
    RobotFigures,
    Sector,
)
from poise.training.statistics.bootstrap import EnvelopeFit, mean_over_directions
from poise.training.statistics.eurobench import (
    HUMAN_COM_HEIGHT,
    Size,
    energy_factor,
    force_factor,
    human_reach,
    mean_or_none,
    stability_margin,
)
from poise.training.statistics.fits import fit_logistic
from poise.training.statistics.rates import eta, mcnemar, wilson_interval
from poise.training.suites.factors import STANDARD
from poise.training.suites.plan import Plan
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.step_limits import NStepLimit
from poise.training.trials.trial import Outcome, Trial

Played = Sequence[tuple[Trial, Outcome]]  # by one controller, in the order of the numbers
RATED = "mix"  # the part that the counts are of, where a suite has it
DIRECTIONAL = ("envelope", "grid")  # parts that J50 of each direction is fitted to
SECTOR = 45.0  # [deg] in which random directions are counted together


def controller_entry(played: Played, plan: Plan, steps: NStepLimit | None = None) -> Entry:
    """All figures of one controller; `steps` is the limit of one that steps."""
    entry: Entry = {
        **counts([outcome for _, outcome in rated(played)]),
        "root_force_max": max((outcome.root_force or 0.0) for _, outcome in played),
        "played": len(played),
        "errors": sum(outcome.error is not None for _, outcome in played),
    }
    if directional := part(played, *DIRECTIONAL):
        entry.update(envelope(directional, plan.limits, steps))
    if random := part(played, "random"):
        entry.update(_fractions(random, plan.limits))
    if factors := _factors(part(played, "factors"), plan.standard):
        entry["factors"] = factors
    if part(played, "envelope", "margin"):
        entry["eurobench"] = _eurobench(played, plan.limits)
    return entry


def part(played: Played, *names: str) -> Played:
    """The trials of some parts."""
    return [(trial, outcome) for trial, outcome in played if trial.part in names]


def rated(played: Played) -> Played:
    """The trials that a controller is rated by: those of the mix, else all."""
    return part(played, RATED) or played


def pushes(played: Played) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direction [deg], impulse [N·s] and duration [s] of every trial's push."""
    found = [(t.push.direction, t.push.impulse, t.push.duration) for t, _ in played if t.push]
    direction, impulse, duration = np.array(found).reshape(-1, 3).T
    return direction, impulse, duration


def won(played: Played) -> np.ndarray:
    """Whether each trial was recovered."""
    return np.array([outcome.recovered for _, outcome in played], dtype=bool)


def fractions(played: Played) -> np.ndarray:
    """Impulse over the limit of every trial."""
    return np.array([trial.limit_fraction for trial, _ in played], dtype=float)


def sectors(played: Played) -> EnvelopeFit:
    """Fits of the share of the limit in sectors of 45°, named by their middle."""
    direction, _, _ = pushes(played)
    middle = SECTOR * (np.rint(direction / SECTOR) % (360.0 / SECTOR))
    return mean_over_directions(middle, fractions(played), won(played))


def rate(recovered: Sequence[bool]) -> Rate:
    """How many were recovered."""
    trials, count = len(recovered), int(sum(recovered))
    return {
        "trials": trials,
        "recovered": count,
        "recovered_rate": count / trials,
        "recovered_ci95": wilson_interval(count, trials),
    }


def counts(outcomes: Sequence[Outcome]) -> Counts:
    """How many were recovered, how, and medians of what was recorded."""
    standing = [outcome for outcome in outcomes if outcome.recovered]
    trials, fallen = len(outcomes), sum(outcome.fallen for outcome in outcomes)

    def over(
        name: str, function: Callable[[list[float]], float], chosen: Sequence[Outcome] = outcomes
    ) -> float | None:
        values = [getattr(outcome, name) for outcome in chosen]
        values = [value for value in values if value is not None]
        return float(function(values)) if values else None

    return {
        **rate([outcome.recovered for outcome in outcomes]),
        "fallen": fallen,
        "never_fell_rate": 1.0 - fallen / trials,
        "never_fell_ci95": wilson_interval(trials - fallen, trials),
        "recovered_with_step": sum(outcome.foot_displaced for outcome in standing),
        "recovered_in_place": sum(o.steps == 0 and not o.foot_displaced for o in standing),
        "steps_mean": over("steps", np.mean),
        "steps_max": over("steps", np.max),
        "solver_failures": sum(outcome.solver_failures for outcome in outcomes),
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
    }


def envelope(played: Played, limits: PushLimits, steps: NStepLimit | None = None) -> Envelope:
    """J50 [N·s], J90, η and the share of the limit of `steps` in each direction; their means."""
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
    figures: Envelope = {
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


def ankle_limits(played: Played, limits: PushLimits) -> np.ndarray:
    """The ankle limit [N·s] for the push of every trial."""
    direction, _, duration = pushes(played)
    return np.array([limits.ankle(d, t) for d, t in zip(direction, duration, strict=True)])


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


def _factors(played: Played, standard: Mapping[str, str]) -> list[Factor]:
    """Recovered rate of every level, and what it lost and won against the standard case."""
    cells: dict[tuple[str, str], list[bool]] = {}
    for trial, outcome in played:
        cells.setdefault((str(trial.factor), str(trial.level)), []).append(outcome.recovered)
    base = cells.pop((STANDARD, STANDARD), [])
    found: dict[str, list[Level]] = {}
    for (factor, level), recovered in cells.items():
        found.setdefault(factor, []).append(_level(level, recovered, base))
    for factor, levels in found.items():
        levels.append({**_level(standard[factor], base, base), "standard": True})
        if factor != "body":
            levels.sort(key=lambda entry: float(entry["level"]))
    return [{"factor": factor, "standard": standard[factor], "levels": levels}
            for factor, levels in found.items()]  # fmt: skip


def _level(level: str, recovered: Sequence[bool], base: Sequence[bool]) -> Level:
    lost = sum(b and not r for r, b in zip(recovered, base, strict=True))
    gained = sum(r and not b for r, b in zip(recovered, base, strict=True))
    return {
        "level": level,
        "standard": False,
        **rate(recovered),
        "lost": lost,
        "won": gained,
        "p_mcnemar": mcnemar(lost, gained).p_value,
    }


def _eurobench(played: Played, limits: PushLimits) -> Eurobench:
    """Sway and recovery time over recovered standard pushes; stability margins."""
    plain = [outcome for _, outcome in part(played, "envelope") if outcome.recovered]
    return {
        "body_sway_mean": mean_or_none([outcome.sway for outcome in plain]),
        "recovery_time_mean": mean_or_none([outcome.sway_recovery for outcome in plain]),
        "recovery_time_trials": sum(outcome.sway_recovery is not None for outcome in plain),
        "trials": len(plain),
        "margins": _margins(part(played, "margin"), limits),
    }


def _margins(played: Played, limits: PushLimits) -> list[Margin]:
    """Stability margin per direction: force [N], energy [J], and both on a human's scale."""
    if not played:
        return []
    direction, impulse, duration = pushes(played)
    fallen = ~won(played)  # not recovered counts as a fall: the protocol knows no third end
    robot, found = limits.robot, []
    for angle in dict.fromkeys(direction.tolist()):
        here = direction == angle
        largest = stability_margin(impulse[here], fallen[here])
        margin: Margin = {"direction": angle, "impulse": largest}
        if largest is not None:
            size = Size(robot.mass, robot.height_com, limits.margin(angle))
            reach = human_reach(angle)
            force, energy = largest / float(duration[here][0]), largest**2 / (2.0 * robot.mass)
            margin |= {
                "force": force,
                "force_normalised": force / force_factor(size, reach),
                "energy": energy,
                "energy_normalised": energy / energy_factor(size, reach),
                "largest_tried": largest == float(impulse[here].max()),
            }
        found.append(margin)
    return found


def robot_figures(limits: PushLimits) -> RobotFigures:
    """What a report needs of the robot."""
    robot = limits.robot
    return {
        "name": robot.name,
        "mass": robot.mass,
        "height_com": robot.height_com,
        "omega": robot.omega,
        "human_com_height": HUMAN_COM_HEIGHT,
        "ankle_limit": [(float(a), limits.ankle(float(a), 0.1)) for a in range(0, 360, 5)],
    }
