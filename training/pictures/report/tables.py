"""The tables of a report, from a summary."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from poise.training.benchmarking.evaluation.tables import places
from poise.training.benchmarking.results.read import Results
from poise.training.running.columns import (
    AGAINST,
    AIMED,
    ERRORS,
    ETA_MEAN,
    ETA_WORST,
    FAILURES,
    FAILURES_RECOVERED,
    FALLS,
    GAIN,
    HALF_AT,
    J50_BOUNDED,
    J50_MEAN,
    J50_PER_MASS,
    J50_WORST,
    LOSSES,
    P_VALUE,
    PAIRED,
    RECOVERED,
    ROOT,
    TICK,
    TRIED,
    Entry,
)
from poise.training.running.summary import Direction, Sector
from poise.training.running.trial_figures import Bound

from .cells import (
    Cell,
    Column,
    Table,
    cell,
    figure_cell,
    figure_column,
    figure_table,
    name_cell,
    p_cell,
)
from .worst_trials import smallest_lost

SMALLEST = 3  # pushes listed for each controller


def ranking(results: Results, baseline: str) -> Table:
    """Every controller with what the benchmark measures, the best first."""
    order, ranked = results.controllers, results.summary["ranking"]
    scale = results.summary["scale"]
    against, rated = _against(results, baseline), results.summary["rated"]
    mix = f" of the {rated}" if rated else ""
    half = replace(HALF_AT, words=f"half of the trials survive, of the {scale}")
    rate = replace(RECOVERED, words=f"fraction of all trials{mix}")
    found = (J50_MEAN, J50_PER_MASS, J50_WORST, J50_BOUNDED, ETA_MEAN, ETA_WORST, half, rate,
             replace(TRIED[0], words=f"that the rate is of{mix}"))  # fmt: skip
    others = (FALLS[1], ERRORS, FAILURES, FAILURES_RECOVERED, TICK, ROOT)
    columns = [
        Column("rank", "#", "by mean J50, else by the fraction of the limit, else by rate"),
        Column("controller", "controller"),
        *map(figure_column, found),
        *map(figure_column, (*AGAINST, P_VALUE, *others)),
    ]
    rows = []
    rank = places(results.summary["controllers"])
    for name in ranked:
        entry = results.summary["controllers"][name]
        pair = against.get(name, {})
        rows.append([
            cell(rank[name], "d"),
            name_cell(name, order.index(name)),
            *(figure_cell(each, entry) for each in found),
            *(figure_cell(each, pair) for each in AGAINST),
            p_cell(pair.get("p_mcnemar")),
            *(figure_cell(each, entry) for each in others),
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
        *map(figure_column, PAIRED),
        figure_column(P_VALUE),
        figure_column(GAIN),
    ]
    rows, order = [], results.controllers
    for pair in results.summary["pairs"]:
        rows.append([
            *(name_cell(name, order.index(name)) for name in (pair["b"], pair["a"])),
            *(figure_cell(each, pair) for each in PAIRED),
            p_cell(pair.get("p_mcnemar")),
            figure_cell(GAIN, pair),
        ])  # fmt: skip
    return Table("pairs", "All pairs on the same trials.", columns, rows).without_empty()


def directions(results: Results) -> Table | None:
    """J50 or the fraction of the limit in every direction; None where no suite measured it."""
    entries = results.summary["controllers"].values()
    key = "directions" if any(entry.get("directions") for entry in entries) else "sectors"
    columns = [Column("direction", "direction [°]", "counter-clockwise from forward")]
    table = Table("directions", "Every direction.", columns, [])
    return figure_table(results, results.controllers, key, table, (*TRIED, *AIMED),
                        lambda entry: [cell(entry["direction"], "g")])  # fmt: skip


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


def _against(results: Results, baseline: str) -> dict[str, Entry]:
    """controller → trials lost and won against the baseline, and p."""
    found: dict[str, Entry] = {}
    for pair in results.summary["pairs"]:
        if baseline not in (pair["a"], pair["b"]) or "p_mcnemar" not in pair:
            continue
        lost, won, other = pair["only_a"], pair["only_b"], pair["b"]
        if other == baseline:
            lost, won, other = won, lost, pair["a"]
        found[other] = {"lost": lost, "won": won, "p_mcnemar": pair["p_mcnemar"]}
    return found


def losses(results: Results, order: Sequence[str]) -> Table | None:
    """How often what was the cause of a loss; None in older results, and where nothing was lost."""
    columns = [
        Column("controller", "controller"),
        figure_column(LOSSES),
        Column("cause", "cause"),
    ]
    rows = [
        [name_cell(name, results.controllers.index(name)), figure_cell(LOSSES, loss),
         Cell(loss["cause"], loss["cause"])]
        for name in order
        for loss in results.summary["controllers"][name].get("losses", [])
    ]  # fmt: skip
    caption = "Causes of lost trials, the most frequent one of each controller first."
    return Table("losses", caption, columns, rows) if rows else None


def smallest(results: Results, order: Sequence[str]) -> Table:
    """The smallest pushes that each controller did not recover."""
    columns = [
        Column("controller", "controller"),
        Column("trial", "trial", "its number in trials.csv"),
        Column("limit_fraction", "push", "fraction of the limit"),
        Column("impulse", "impulse [N·s]"),
        Column("direction", "direction [°]", "counter-clockwise from forward"),
        Column("duration", "duration [s]"),
        Column("body", "body"),
        Column("fall_time", "fell at [s]", "after the reset; none: stood, but not quiet"),
        Column("why", "why"),
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
