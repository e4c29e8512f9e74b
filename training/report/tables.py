"""The tables of a report, from a summary."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.training.results.read import Results
from poise.training.results.values import interval, number
from poise.training.statistics.rates import wilson_interval

from .cells import Cell, Column, Table, cell, name_cell, p_cell
from .worst_trials import smallest_lost

SMALLEST = 3  # pushes listed for each controller
ROOT_FORCE = 1.0  # [N] more than a numerical residual
STEP_LIMITS = {"1": "1-step limit", "2": "2-step limit", "inf": "∞-step limit"}
BOUNDS = {None: "", "lower": "≥ ", "upper": "≤ "}


def ranked(results: Results) -> list[str]:
    """Controllers, the best first: by mean J50, else by the share of the limit, else by rate."""
    entries = results.summary["controllers"]
    for key in ("j50_mean", "fraction50", "recovered_rate"):
        if all(isinstance(entry.get(key), (int, float)) for entry in entries.values()):
            return sorted(entries, key=lambda name: -entries[name][key])
    return list(entries)


def assisted(results: Results, name: str) -> bool:
    """Whether a controller took force from nowhere, at a soft root."""
    entry, where = results.summary["controllers"][name], f"{results.folder}: summary.json"
    return (number(entry, "root_force_max", where) or 0.0) > ROOT_FORCE


def ranking(results: Results, baseline: str) -> Table:
    """Every controller with what the benchmark measures, the best first."""
    order = results.controllers
    against = _against(results, baseline)
    mix = " of the mix" if results.parts else ""
    columns = [
        Column("rank", "#", "by mean J50, else by the share of the limit, else by rate"),
        Column("controller", "Controller"),
        Column("j50_mean", "J50 [N·s]", "impulse that half of the trials survive, mean over "
               "directions", interval=True),
        Column("j50_per_mass", "J50/m [N·s/kg]", "the same over the robot's mass"),
        Column("j50_worst", "J50 worst [N·s]", "in the worst direction"),
        Column("j50_bounds", "Bounds", "directions in which J50 is only a bound"),
        Column("eta_mean", "η mean", "J50 over the ankle limit, mean of all", interval=True),
        Column("eta_worst", "η worst", "in the worst direction"),
        Column("fraction50", "Half at", f"half of the trials survive, of the {results.scale}"),
        Column("recovered_rate", "Recovered", f"share of all trials{mix}", interval=True),
        Column("trials", "Trials", f"that the rate is of{mix}"),
        Column("lost", "Lost", f"trials that {baseline} recovers and this controller does not"),
        Column("won", "Won", f"trials that this controller recovers and {baseline} does not"),
        Column("p_mcnemar", "p", "McNemar's exact test of lost against won"),
        Column("fallen", "Falls", "trials that ended on the ground"),
        Column("errors", "Errors", "trials in which the controller raised an error"),
        Column("solver_failures", "QP failures", "control ticks at which the QP was not solved"),
        Column("tick_us", "Tick [µs]", "time of one control tick"),
        Column("root_force_max", "Root [N]", "largest force that a soft root took from nowhere"),
    ]  # fmt: skip
    rows = []
    fair = [name for name in ranked(results) if not assisted(results, name)]
    for name in ranked(results):
        entry = results.summary["controllers"][name]
        where = f"{results.folder}: summary.json: controllers.{name}"

        def value(key: str, entry: Mapping[str, Any] = entry, where: str = where) -> float | None:
            return number(entry, key, where)

        lost, won, p = against.get(name, (None, None, None))
        rate, root = value("recovered_rate"), value("root_force_max")
        count, of = int(value("recovered") or 0), int(value("trials") or 0)
        bound = BOUNDS.get(entry.get("fraction50_bound"), "")
        rows.append([
            cell(fair.index(name) + 1 if name in fair else None, "d"),
            name_cell(name, order.index(name)),
            cell(value("j50_mean"), ".1f", interval(entry, "j50_mean_ci95", where)),
            cell(value("j50_mean_per_mass"), ".3f"),
            cell(value("j50_min"), ".1f"),
            cell(value("j50_bounded") or None, "g"),
            cell(value("eta_mean"), ".2f", interval(entry, "eta_mean_ci95", where)),
            cell(value("eta_min"), ".2f"),
            cell(value("fraction50"), ".2f", sign=bound),
            cell(rate, ".1%", wilson_interval(count, of)),
            cell(of, "d"),
            cell(lost, "d"),
            cell(won, "d"),
            p_cell(p),
            cell(value("fallen"), "d"),
            cell(value("errors") or None, "d"),
            cell(value("solver_failures"), "d"),
            cell(value("tick_us"), ".0f"),
            cell(root or None, ".0f"),
        ])  # fmt: skip
    caption = f"Controllers, the best first. Lost and won are counted against {baseline}."
    if results.parts:
        caption = caption[:-1] + "; like the recovered rate, on the random mix."
    return Table("ranking", caption, columns, rows).without_empty()


def pairs(results: Results) -> Table:
    """Every pair of controllers on the same trials."""
    columns = [
        Column("b", "b"),
        Column("a", "against a"),
        Column("both", "Both", "recovered by both"),
        Column("only_a", "Only a", "lost by b"),
        Column("only_b", "Only b", "won by b"),
        Column("neither", "Neither"),
        Column("p_mcnemar", "p", "McNemar's exact test"),
        Column("j50_gain", "J50 gain", "of b over a, relative", interval=True),
    ]
    rows, order = [], results.controllers
    for k, pair in enumerate(results.summary.get("pairs", [])):
        where = f"{results.folder}: summary.json: pairs.{k}"
        names = [_member(pair.get(key), order, where) for key in ("b", "a")]
        counts = [number(pair, key, where) for key in ("both", "only_a", "only_b", "neither")]
        gain = cell(number(pair, "j50_gain", where), "+.1%", interval(pair, "j50_gain_ci95", where))
        rows.append([
            *(name_cell(name, order.index(name)) for name in names),
            *(cell(count, "g") for count in counts),
            p_cell(number(pair, "p_mcnemar", where)),
            gain,
        ])  # fmt: skip
    return Table("pairs", "All pairs on the same trials.", columns, rows).without_empty()


def directions(results: Results) -> Table | None:
    """J50 or the share of the limit in every direction; None where no suite measured it."""
    columns = [
        Column("controller", "Controller"),
        Column("direction", "Direction [°]", "counter-clockwise from forward"),
        Column("trials", "Trials"),
        Column("recovered", "Recovered"),
        Column("j50", "J50 [N·s]", interval=True),
        Column("j90", "J90 [N·s]", interval=True),
        Column("fraction50", "Half at", "share of the limit", interval=True),
        Column("ankle_limit", "Ankle limit [N·s]"),
        Column("eta", "η"),
    ]
    for name, title in STEP_LIMITS.items():
        columns.append(Column(f"step_limit_{name}", title, "of a pendulum that steps [N·s]"))
        columns.append(Column(f"step_share_{name}", "of it", "share of that limit that J50 is"))
    rows: list[list[Cell]] = []
    for name, index, entry, where in per_direction(results):
        bound = BOUNDS.get(entry.get("j50_bound", entry.get("fraction50_bound")), "")

        def shown(
            key: str, form: str, ends: str = "", sign: str = "",
            entry: Mapping[str, Any] = entry, where: str = where,
        ) -> Cell:  # fmt: skip
            found = interval(entry, ends, where) if ends else None
            return cell(number(entry, key, where), form, found, sign)

        rows.append([
            name_cell(name, index),
            shown("direction", "g"),
            shown("trials", "g"),
            shown("recovered", "g"),
            shown("j50", ".1f", "j50_ci95", bound),
            shown("j90", ".1f", "j90_ci95"),
            shown("fraction50", ".2f", "fraction50_ci95", bound),
            shown("ankle_limit", ".1f"),
            shown("eta", ".2f"),
        ])  # fmt: skip
        for key in STEP_LIMITS:
            share = shown(f"step_share_{key}", ".2f", sign=bound)
            rows[-1] += [shown(f"step_limit_{key}", ".1f"), share]
    if not rows:
        return None
    return Table("directions", "Every direction.", columns, rows).without_empty()


def per_direction(results: Results) -> list[tuple[str, int, Mapping[str, Any], str]]:
    """(controller, its number, entry, where) of all directions or sectors of the summary."""
    found = []
    for index, (name, entry) in enumerate(results.summary["controllers"].items()):
        where = f"{results.folder}: summary.json: controllers.{name}"
        entries = entry.get("directions", entry.get("sectors", []))
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            number({"directions": entries}, "directions", where, needed=True)  # raises
        found += [(name, index, e, where) for e in entries]
    return found


def _against(results: Results, baseline: str) -> dict[str, tuple[float, float, float | None]]:
    """controller → (trials lost, trials won, p) against the baseline."""
    found: dict[str, tuple[float, float, float | None]] = {}
    for k, pair in enumerate(results.summary.get("pairs", [])):
        where = f"{results.folder}: summary.json: pairs.{k}"
        a, b, p = pair.get("a"), pair.get("b"), number(pair, "p_mcnemar", where)
        only_a = int(number(pair, "only_a", where, needed=True) or 0)
        only_b = int(number(pair, "only_b", where, needed=True) or 0)
        if a == baseline:
            found[str(b)] = (only_a, only_b, p)
        elif b == baseline:
            found[str(a)] = (only_b, only_a, p)
    return found


def _member(name: Any, names: tuple[str, ...], where: str) -> str:
    if name not in names:
        raise ConfigError(f"no such controller: {shown(name)}", source=where, choices=names)
    return str(name)


def smallest(results: Results, order: Sequence[str]) -> Table:
    """The smallest pushes that each controller did not recover."""
    columns = [
        Column("controller", "Controller"),
        Column("trial", "Trial", "its number in trials.csv"),
        Column("limit_fraction", "Push", "share of the limit"),
        Column("impulse", "Impulse [N·s]"),
        Column("direction", "Direction [°]", "counter-clockwise from forward"),
        Column("duration", "Duration [s]"),
        Column("body", "Body"),
        Column("fall_time", "Fell at [s]", "after the reset; none: stood, but not quiet"),
    ]
    rows = []
    for name in order:
        for record in smallest_lost(results, name)[:SMALLEST]:
            body = record.line["body"]
            rows.append([
                name_cell(name, results.controllers.index(name)),
                cell(record.trial, "d"),
                _number_cell(record.fraction, ".2f"),
                _number_cell(record.impulse, ".1f"),
                _number_cell(record.direction, ".0f"),
                _number_cell(record.duration, ".2f"),
                Cell(body or None, body or "–"),
                _number_cell(record.fall_time, ".2f"),
            ])  # fmt: skip
    caption = f"The {SMALLEST} smallest pushes that each controller did not recover."
    return Table("smallest_lost", caption, columns, rows).without_empty()


def _number_cell(value: float, form: str) -> Cell:
    return cell(value if math.isfinite(value) else None, form)
