"""The tables of a report, from a summary."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

from poise.training.benchmarking.evaluation.tables import BOUNDS, places
from poise.training.benchmarking.results.read import Results
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.running.summary import Bound, Direction, Sector

from .cells import Cell, Column, Table, cell, figure_cell, name_cell, p_cell
from .worst_trials import smallest_lost

SMALLEST = 3  # pushes listed for each controller
STEP_LIMITS = {"1": "1-step limit", "2": "2-step limit", "inf": "∞-step limit"}


def ranking(results: Results, baseline: str) -> Table:
    """Every controller with what the benchmark measures, the best first."""
    order, ranked = results.controllers, results.summary["ranking"]
    scale = results.summary["scale"]
    against, rated = _against(results, baseline), results.summary["rated"]
    mix = f" of the {rated}" if rated else ""
    columns = [
        Column("rank", "#", "by mean J50, else by the fraction of the limit, else by rate"),
        Column("controller", "Controller"),
        Column("j50_mean", "J50 [N·s]", "impulse that half of the trials survive, mean over "
               "directions", interval=True),
        Column("j50_per_mass", "J50/m [N·s/kg]", "the same over the robot's mass"),
        Column("j50_worst", "J50 worst [N·s]", "in the worst direction"),
        Column("j50_bounds", "Bounds", "directions in which J50 is only a bound"),
        Column("eta_mean", "η mean", "J50 over the ankle limit, mean of all", interval=True),
        Column("eta_worst", "η worst", "in the worst direction"),
        Column("fraction50", "Half at", f"half of the trials survive, of the {scale}"),
        Column("recovered_rate", "Recovered", f"fraction of all trials{mix}", interval=True),
        Column("trials", "Trials", f"that the rate is of{mix}"),
        Column("lost", "Lost", f"trials that {baseline} recovers and this controller does not"),
        Column("won", "Won", f"trials that this controller recovers and {baseline} does not"),
        Column("p_mcnemar", "p", "McNemar's exact test of lost against won"),
        Column("fallen", "Falls", "trials that ended on the ground"),
        Column("errors", "Errors", "trials in which the controller raised an error"),
        Column("solver_failures", "QP failures", "control ticks at which the QP was not solved"),
        Column("solver_failures_recovered", "of them in recoveries", "in trials that recovered"),
        Column("tick_us", "Tick [µs]", "time of one control tick"),
        Column("root_force_max", "Root [N]", "largest force that a soft root took from nowhere"),
    ]  # fmt: skip
    rows = []
    rank = places(results.summary["controllers"])
    for name in ranked:
        entry = results.summary["controllers"][name]
        lost, won, p = against.get(name, (None, None, None))
        bound = BOUNDS.get(entry.get("fraction50_bound"), "")
        rows.append([
            cell(rank[name], "d"),
            name_cell(name, order.index(name)),
            figure_cell(entry, "j50_mean", ".1f", "j50_mean_ci95"),
            figure_cell(entry, "j50_mean_per_mass", ".3f"),
            figure_cell(entry, "j50_min", ".1f"),
            cell(entry.get("j50_bounded") or None, "d"),
            figure_cell(entry, "eta_mean", ".2f", "eta_mean_ci95"),
            figure_cell(entry, "eta_min", ".2f"),
            figure_cell(entry, "fraction50", ".2f", sign=bound),
            cell(entry["recovered_rate"], ".1%",
                 wilson_interval(entry["recovered"], entry["trials"])),
            cell(entry["trials"], "d"),
            cell(lost, "d"),
            cell(won, "d"),
            p_cell(p),
            figure_cell(entry, "fallen", "d"),
            cell(entry["errors"] or None, "d"),
            figure_cell(entry, "solver_failures", "d"),
            figure_cell(entry, "solver_failures_recovered", "d"),
            figure_cell(entry, "tick_us", ".0f"),
            cell(entry.get("root_force_max") or None, ".0f"),
        ])  # fmt: skip
    caption = f"Controllers, the best first. Lost and won are counted against {baseline}."
    if rated:
        caption = f"{caption[:-1]}; like the recovered rate, on the random {rated}."
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
    for pair in results.summary["pairs"]:
        rows.append([
            *(name_cell(name, order.index(name)) for name in (pair["b"], pair["a"])),
            *(figure_cell(pair, key, "d") for key in ("both", "only_a", "only_b", "neither")),
            p_cell(pair.get("p_mcnemar")),
            figure_cell(pair, "j50_gain", "+.1%", "j50_gain_ci95"),
        ])  # fmt: skip
    return Table("pairs", "All pairs on the same trials.", columns, rows).without_empty()


def directions(results: Results) -> Table | None:
    """J50 or the fraction of the limit in every direction; None where no suite measured it."""
    columns = [
        Column("controller", "Controller"),
        Column("direction", "Direction [°]", "counter-clockwise from forward"),
        Column("trials", "Trials"),
        Column("recovered", "Recovered"),
        Column("j50", "J50 [N·s]", interval=True),
        Column("j90", "J90 [N·s]", interval=True),
        Column("fraction50", "Half at", "fraction of the limit", interval=True),
        Column("ankle_limit", "Ankle limit [N·s]"),
        Column("eta", "η"),
    ]
    for name, title in STEP_LIMITS.items():
        columns.append(Column(f"step_limit_{name}", title, "of a pendulum that steps [N·s]"))
        columns.append(Column(f"step_share_{name}", "of it", "fraction of that limit that J50 is"))
    rows: list[list[Cell]] = []
    for name, index, entry in per_direction(results):
        bound = BOUNDS[bound_of(entry)]
        rows.append([
            name_cell(name, index),
            *(figure_cell(entry, key, "g") for key in ("direction", "trials", "recovered")),
            figure_cell(entry, "j50", ".1f", "j50_ci95", bound),
            figure_cell(entry, "j90", ".1f", "j90_ci95"),
            figure_cell(entry, "fraction50", ".2f", "fraction50_ci95", bound),
            figure_cell(entry, "ankle_limit", ".1f"),
            figure_cell(entry, "eta", ".2f"),
        ])  # fmt: skip
        for key in STEP_LIMITS:
            fraction = figure_cell(entry, f"step_share_{key}", ".2f", sign=bound)
            rows[-1] += [figure_cell(entry, f"step_limit_{key}", ".1f"), fraction]
    if not rows:
        return None
    return Table("directions", "Every direction.", columns, rows).without_empty()


def per_direction(results: Results) -> list[tuple[str, int, Direction | Sector]]:
    """(controller, its number, entry) of all directions, or of all sectors where there are none."""
    return [
        (name, index, each)
        for index, (name, entry) in enumerate(results.summary["controllers"].items())
        for each in entry.get("directions") or entry.get("sectors", [])
    ]


def bound_of(entry: Direction | Sector) -> Bound:
    """What a figure is only a bound of, if so."""
    bound = entry.get("j50_bound") or entry.get("fraction50_bound")
    return cast(Bound, bound)


def _against(results: Results, baseline: str) -> dict[str, tuple[int, int, float]]:
    """controller → (trials lost, trials won, p) against the baseline."""
    found: dict[str, tuple[int, int, float]] = {}
    for pair in results.summary["pairs"]:
        if baseline not in (pair["a"], pair["b"]) or "p_mcnemar" not in pair:
            continue
        if pair["a"] == baseline:
            found[pair["b"]] = (pair["only_a"], pair["only_b"], pair["p_mcnemar"])
        else:
            found[pair["a"]] = (pair["only_b"], pair["only_a"], pair["p_mcnemar"])
    return found


def losses(results: Results, order: Sequence[str]) -> Table | None:
    """How often what was the cause of a loss; None in older results, and where nothing was lost."""
    columns = [
        Column("controller", "Controller"),
        Column("trials", "Losses"),
        Column("cause", "Cause"),
    ]
    rows = [
        [name_cell(name, results.controllers.index(name)), cell(loss["trials"], "d"),
         Cell(loss["cause"], loss["cause"])]
        for name in order
        for loss in results.summary["controllers"][name].get("losses", [])
    ]  # fmt: skip
    caption = "Causes of lost trials, the most frequent one of each controller first."
    return Table("losses", caption, columns, rows) if rows else None


def smallest(results: Results, order: Sequence[str]) -> Table:
    """The smallest pushes that each controller did not recover."""
    columns = [
        Column("controller", "Controller"),
        Column("trial", "Trial", "its number in trials.csv"),
        Column("limit_fraction", "Push", "fraction of the limit"),
        Column("impulse", "Impulse [N·s]"),
        Column("direction", "Direction [°]", "counter-clockwise from forward"),
        Column("duration", "Duration [s]"),
        Column("body", "Body"),
        Column("fall_time", "Fell at [s]", "after the reset; none: stood, but not quiet"),
        Column("why", "Why"),
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
                Cell(record.why or None, record.why or "–"),
            ])  # fmt: skip
    caption = f"The {SMALLEST} smallest pushes that each controller did not recover."
    return Table("smallest_lost", caption, columns, rows).without_empty()


def _number_cell(value: float, form: str) -> Cell:
    return cell(value if math.isfinite(value) else None, form)
