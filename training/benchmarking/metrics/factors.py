"""Figures of factors that are varied alone, and EUROBENCH's indicators."""

from collections.abc import Mapping

from poise.training.benchmarking.statistics.eurobench import (
    Size,
    energy_factor,
    force_factor,
    human_reach,
    stability_margin,
)
from poise.training.benchmarking.statistics.rates import mcnemar, mean_or_none
from poise.training.benchmarking.suites.factors import STANDARD
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.running.summary import Eurobench, Factor, Level, MarginFigures

from .evaluated import Evaluated, cells, pushes, rate, trials_of_parts, won

NAMED = ("body", "realism")  # factors whose levels are names, not numbers


def factor_figures(evaluated: Evaluated, standard: Mapping[str, str]) -> list[Factor]:
    """Return the recovered rate of every level, and what it lost and won against the standard
    case."""
    found_cells = cells(evaluated, lambda trial: (str(trial.factor), str(trial.level)))
    base = found_cells.pop((STANDARD, STANDARD), [])
    found: dict[str, list[Level]] = {}
    for (factor, level), own in found_cells.items():
        found.setdefault(factor, []).append(_level(level, own, base))
    for factor, levels in found.items():
        levels.append({**_level(standard[factor], base, base), "standard": True})
        if factor not in NAMED:
            levels.sort(key=lambda entry: float(entry["level"]))
    return [{"factor": factor, "standard": standard[factor], "levels": levels}
            for factor, levels in found.items()]  # fmt: skip


def _level(level: str, evaluated: Evaluated, base: Evaluated) -> Level:
    pairs = list(zip(won(evaluated).tolist(), won(base).tolist(), strict=True))
    lost = sum(b and not r for r, b in pairs)
    gained = sum(r and not b for r, b in pairs)
    return {
        "level": level,
        "standard": False,
        **rate(evaluated),
        "lost": lost,
        "won": gained,
        "p_mcnemar": mcnemar(lost, gained),
    }


def eurobench_figures(evaluated: Evaluated, limits: PushLimits) -> Eurobench:
    """Return the sway and recovery time over recovered standard pushes; stability margins."""
    plain = [outcome for _, outcome in trials_of_parts(evaluated, "envelope") if outcome.recovered]
    return {
        "body_sway_mean": mean_or_none([outcome.sway for outcome in plain]),
        "recovery_time_mean": mean_or_none([outcome.sway_recovery for outcome in plain]),
        "recovery_time_trials": sum(outcome.sway_recovery is not None for outcome in plain),
        "trials": len(plain),
        "margins": _margins(trials_of_parts(evaluated, "margin"), limits),
    }


def _margins(evaluated: Evaluated, limits: PushLimits) -> list[MarginFigures]:
    """Return the stability margin per direction: force [N], energy [J], and both on a human's
    scale."""
    if not evaluated:
        return []
    direction, impulse, duration = pushes(evaluated)
    fallen = ~won(evaluated)  # not recovered counts as a fall: the protocol has no third outcome
    robot, found = limits.robot, []
    for angle in dict.fromkeys(direction.tolist()):
        here = direction == angle
        largest = stability_margin(impulse[here], fallen[here])
        margin: MarginFigures = {"direction": angle, "impulse": largest}
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
