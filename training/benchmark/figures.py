"""What a benchmark found: the figures of every controller, plain values for summary.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from poise.training.evaluation.summary import counts, envelope, pushes, won
from poise.training.statistics.bootstrap import mean_over_directions
from poise.training.statistics.differences import paired_rates, relative_gain
from poise.training.statistics.eurobench import (
    HUMAN_COM_HEIGHT,
    Size,
    energy_factor,
    force_factor,
    human_reach,
    mean_or_none,
    stability_margin,
)
from poise.training.statistics.rates import mcnemar, wilson_interval
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.step_limits import NStepLimit

from .case import Case, Result
from .cases import STANDARD, Cases

Played = Sequence[tuple[Case, Result]]  # by one controller, in the order of the numbers


def controller_figures(
    played: Played, cases: Cases, steps: NStepLimit | None = None
) -> dict[str, Any]:
    """All figures of one controller; `steps` is the limit of one that steps."""
    limits = cases.limits
    mix, factors = part(played, "mix"), part(played, "factors")
    return {
        "trials": len(played),
        "errors": sum(result.error is not None for _, result in played),
        "root_force_max": max((result.outcome.root_force or 0.0) for _, result in played),
        **_envelope(part(played, "envelope"), limits, steps),
        "mix": counts([result.outcome for _, result in mix]) if mix else None,
        "factors": _factors(factors, cases.standard),
        "eurobench": _eurobench(played, limits),
    }


def part(played: Played, name: str) -> Played:
    """The cases of one part."""
    return [(case, result) for case, result in played if case.part == name]


def _envelope(played: Played, limits: PushLimits, steps: NStepLimit | None) -> dict[str, Any]:
    """J50, J90 and η per direction, with intervals; η's mean with its own."""
    trials = [case for case, _ in played]
    outcomes = [result.outcome for _, result in played]
    figures = envelope(trials, outcomes, limits, steps)
    direction, impulse, duration = pushes(trials)
    ankle = np.array([limits.ankle(d, t) for d, t in zip(direction, duration, strict=True)])
    fit = mean_over_directions(direction, impulse / ankle, won(outcomes))
    figures["eta_mean_ci95"] = fit.j50_mean_ci
    for entry, one in zip(figures["directions"], fit.fits, strict=True):
        entry["eta_ci95"] = one.j50_ci
        entry["eta90"] = one.fit.j90
    return figures


def _factors(played: Played, standard: Mapping[str, str]) -> list[dict[str, Any]]:
    """Recovered rate of every level, and what it lost and won against the standard case."""
    cells: dict[tuple[str, str], list[bool]] = {}
    for case, result in played:
        cell = cells.setdefault((str(case.factor), str(case.level)), [])
        cell.append(result.outcome.recovered)
    base = cells.pop((STANDARD, STANDARD), None)
    if base is None:
        return []
    found: dict[str, list[dict[str, Any]]] = {}
    for (factor, level), recovered in cells.items():
        found.setdefault(factor, []).append(_level(level, recovered, base))
    order = list(found)
    entries = []
    for factor in order:
        levels = [*found[factor], {**_level(standard[factor], base, base), "standard": True}]
        if factor != "body":
            levels.sort(key=lambda entry: float(entry["level"]))
        entries.append({"factor": factor, "standard": standard[factor], "levels": levels})
    return entries


def _level(level: str, recovered: Sequence[bool], base: Sequence[bool]) -> dict[str, Any]:
    lost = sum(b and not r for r, b in zip(recovered, base, strict=True))
    gained = sum(r and not b for r, b in zip(recovered, base, strict=True))
    trials, count = len(recovered), sum(recovered)
    return {
        "level": level,
        "standard": False,
        "trials": trials,
        "recovered": count,
        "recovered_rate": count / trials,
        "recovered_ci95": wilson_interval(count, trials),
        "lost": lost,
        "won": gained,
        "p_mcnemar": mcnemar(lost, gained).p_value,
    }


def _eurobench(played: Played, limits: PushLimits) -> dict[str, Any]:
    """Sway and recovery time over recovered standard pushes; stability margins."""
    plain = [
        result for case, result in played if case.part == "envelope" and result.outcome.recovered
    ]
    return {
        "body_sway_mean": mean_or_none([result.sway for result in plain]),
        "recovery_time_mean": mean_or_none([result.sway_recovery for result in plain]),
        "recovery_time_trials": sum(result.sway_recovery is not None for result in plain),
        "trials": len(plain),
        "margins": _margins(part(played, "margin"), limits),
    }


def _margins(played: Played, limits: PushLimits) -> list[dict[str, Any]]:
    """Stability margin per direction: force [N], energy [J], and both on a human's scale."""
    robot, entries = limits.robot, []
    # not recovered counts as a fall: the protocol knows no third end
    runs = [
        (case.push.direction, case.push.impulse, case.push.duration, not result.outcome.recovered)
        for case, result in played
        if case.push is not None
    ]
    for angle in dict.fromkeys(run[0] for run in runs):
        here = [run for run in runs if run[0] == angle]
        impulse = stability_margin([run[1] for run in here], [run[3] for run in here])
        entry: dict[str, Any] = {"direction": angle, "impulse": impulse}
        if impulse is not None:
            size = Size(robot.mass, robot.height_com, limits.margin(angle))
            reach = human_reach(angle)
            force, energy = impulse / here[0][2], impulse**2 / (2.0 * robot.mass)
            entry |= {
                "force": force,
                "force_normalised": force / force_factor(size, reach),
                "energy": energy,
                "energy_normalised": energy / energy_factor(size, reach),
                "largest_tried": impulse == max(run[1] for run in here),
            }
        entries.append(entry)
    return entries


def pair_figures(a: str, b: str, played: Mapping[str, Played], entries: Mapping[str, Any]) -> Any:
    """b against a: McNemar on the mix; trials lost on all that both met; gain in mean J50."""
    on_mix = paired(part(played[a], "mix"), part(played[b], "mix"))
    met = paired(played[a], played[b])
    gain, gain_ci = relative_gain(
        entries[a]["j50_mean"], entries[a]["j50_mean_ci95"],
        entries[b]["j50_mean"], entries[b]["j50_mean_ci95"],
    )  # fmt: skip
    return {
        "a": a,
        "b": b,
        **({"mix": on_mix} if on_mix else {"mix": None}),
        "all": met,
        "j50_gain": gain,
        "j50_gain_ci95": gain_ci,
    }


def paired(a: Played, b: Played) -> dict[str, Any] | None:
    """Counts of the trials that both met, alike in all; None without any."""
    others = {case.number: (case, result) for case, result in b}
    table = {(True, True): 0, (True, False): 0, (False, True): 0, (False, False): 0}
    for case, result in a:
        if case.number in others and others[case.number][0] == case:
            table[result.outcome.recovered, others[case.number][1].outcome.recovered] += 1
    if not sum(table.values()):
        return None
    both, only_a, only_b, neither = table.values()
    rate, ends = paired_rates(both, only_a, only_b, neither)
    return {
        "both": both,
        "only_a": only_a,
        "only_b": only_b,
        "neither": neither,
        "p_mcnemar": mcnemar(only_a, only_b).p_value,
        "rate_gain": rate,
        "rate_gain_ci95": ends,
    }


def robot_figures(limits: PushLimits) -> dict[str, Any]:
    """What the report needs of the robot."""
    fine = [float(angle) for angle in range(0, 360, 5)]
    return {
        "mass": limits.robot.mass,
        "height_com": limits.robot.height_com,
        "omega": limits.robot.omega,
        "human_com_height": HUMAN_COM_HEIGHT,
        "ankle_limit": [[angle, limits.ankle(angle, 0.1)] for angle in fine],
    }
