"""What the report shows of controllers that walk: by command, and by the phase of a push."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from markupsafe import Markup

from poise.training.benchmarking.evaluation.tables import BOUNDS
from poise.training.benchmarking.results.read import Results
from poise.training.pictures.figures.rates import phase_curves
from poise.training.pictures.figures.series import SIDES, series
from poise.training.pictures.figures.style import Inline
from poise.training.running.summary import PhaseJ50, WalkLevel, both_ends

from .cells import Cell, Column, Table, cell, figure_cell, name_cell
from .plots import spans

PARTS = {"walk": "walk", "gait": "steps", "velocity": "course", "walk_push": "pushed",
         "walk_kick": "kicked", "walk_repeated": "pushed again and again",
         "terrains": "terrain"}  # fmt: skip
Figures = dict[str, tuple[str, str, str]]
#: key of a level → title, note, format
REACHED: Figures = {
    "steps_as_told_rate": ("Steps as told", "no fall, all within 10 %", ".0%"),
    "step_error": ("off by", "largest of the step parameters told", ".1%"),
    "speed_ahead": ("Ahead [m/s]", "mean over the strides", ".3f"),
    "speed_left": ("Left [m/s]", "mean over the strides", ".3f"),
    "turn_rate": ("Turn [rad/s]", "to the left, mean over the strides", ".3f"),
    "speed_error_rms": ("RMS error [m/s]", "of the strides' velocities from the command", ".3f"),
    "turn_error_rms": ("of the turn [rad/s]", "root mean square over the strides", ".3f"),
    "circle_error": ("Off the circle [m]", "largest distance", ".3f"),
    "surfaces_passed": ("Surfaces passed", "of the terrain, mean", ".1f"),
    "edge_contacts": ("Edges touched", "times that a foot came to touch one, mean", ".2f"),
}
COSTS: Figures = {
    "step_length": ("Step [m]", "length, along the heading", ".3f"),
    "step_width": ("Width [m]", "of a step, across the heading", ".3f"),
    "step_time": ("Time [s]", "between touchdowns", ".3f"),
    "swing_time": ("In the air [s]", "from lift-off to touchdown", ".3f"),
    "step_clearance": ("Clearance [m]", "of the sole's middle at its highest", ".3f"),
    "yaw_momentum": ("Yaw momentum [N·m·s]", "root mean square about the vertical", ".2f"),
    "cost_of_transport": ("Cost of transport", "∫ Σ |τ q̇| dt / (m g d)", ".2f"),
    "positive_cost_of_transport": ("of positive work", "∫ Σ max(τ q̇, 0) dt / (m g d)", ".2f"),
    "knee_mean": ("Stance knee [N·m/kg]", "mean of |τ|/m", ".2f"),
    "knee_peak": ("at most", "largest |τ|/m", ".2f"),
    "foot_slide": ("Slide [m]", "largest way of a sole that bears the robot alone", ".4f"),
}


def walk_table(results: Results, order: Sequence[str]) -> Table | None:
    """Every command of every controller: falls, and what was reached; None without walks."""
    columns = [
        Column("trials", "Trials"),
        Column("fallen", "Falls"),
        Column("falls_per_minute", "Falls a minute", "Garwood's interval", interval=True),
        Column("recovered_rate", "As told", "fraction of trials that end as commanded",
               interval=True),
    ]  # fmt: skip

    def cells(level: WalkLevel) -> list[Cell]:
        return [
            cell(level["trials"], "d"),
            cell(level["fallen"], "d"),
            figure_cell(level, "falls_per_minute", ".2f", "falls_per_minute_ci95"),
            figure_cell(level, "recovered_rate", ".0%", "recovered_ci95"),
        ]

    caption = "What was reached of every command, pushed or not: means over trials."
    return _levels(results, order, Table("walks", caption, columns, []), cells, REACHED)


def cost_table(results: Results, order: Sequence[str]) -> Table | None:
    """The steps of every command of every controller, and what they cost; None without walks."""
    caption = "Steps and their cost, means over trials."
    return _levels(results, order, Table("walk_costs", caption, [], []), lambda level: [], COSTS)


def _levels(
    results: Results, order: Sequence[str], table: Table,
    cells: Callable[[WalkLevel], list[Cell]], figures: Figures,
) -> Table | None:  # fmt: skip
    """A row for each level: its name, `cells` under the table's own columns, and figures."""
    columns = [
        Column("controller", "Controller"),
        Column("part", "Part", "of the suite"),
        Column("level", "Level", "what it is told, or how it is pushed"),
        *table.columns,
        *(Column(key, title, note) for key, (title, note, _) in figures.items()),
    ]
    rows = [
        [
            name_cell(name, results.controllers.index(name)),
            _words(PARTS.get(level["part"], level["part"])),
            _words(level["level"]),
            *cells(level),
            *(_figure(level, key, form) for key, (_, _, form) in figures.items()),
        ]
        for name in order
        for level in results.summary["controllers"][name].get("walks", ())
    ]
    whole = Table(table.name, table.caption, columns, rows).without_empty()
    known = {column.key for column in whole.columns}
    return whole if known & {*figures} else None


def _figure(level: WalkLevel, key: str, form: str) -> Cell:
    """A figure of a level; level ground has no edges that nobody touched."""
    there = key != "edge_contacts" or level.get("surfaces_passed") is not None
    return figure_cell(level if there else {}, key, form)


def phase_table(results: Results, order: Sequence[str]) -> Table | None:
    """J50 in each part of the stride; None where no walk was pushed."""
    columns = [
        Column("controller", "Controller"),
        Column("phase", "Phase", "of the stride when the push begins: 0, the left foot lands"),
        Column("trials", "Trials"),
        Column("recovered", "Recovered"),
        Column("j50", "J50 [N·s]", "impulse that half of the trials survive", interval=True),
    ]
    rows = [
        [
            name_cell(name, results.controllers.index(name)),
            cell(entry["phase"], ".3f"),
            cell(entry["trials"], "d"),
            cell(entry["recovered"], "d"),
            figure_cell(entry, "j50", ".1f", "j50_ci95", BOUNDS[entry["j50_bound"]]),
        ]
        for name, phases in _phases(results, order).items()
        for entry in phases
    ]
    caption = "J50 by the phase of the stride at which the push begins, over all directions."
    return Table("phases", caption, columns, rows) if rows else None


def phase_plot(results: Results, order: Sequence[str]) -> Markup | None:
    """J50 over the phase of the stride, with intervals; None where no walk was pushed."""
    found = [
        series(name, results.controllers.index(name), [
            (each["phase"], each["j50"], *(both_ends(each["j50_ci95"]) or (np.nan, np.nan)),
             SIDES[each["j50_bound"]])
            for each in phases
        ])
        for name, phases in _phases(results, order).items()
    ]  # fmt: skip
    if not found:
        return None
    out = Inline(spans("J50 [N·s] over the phase of the stride", found, ".1f"))
    phase_curves(out, found)
    return out.svg


def _phases(results: Results, order: Sequence[str]) -> dict[str, Sequence[PhaseJ50]]:
    """controller → what is known of its phases, of those that were pushed on a walk."""
    found = {name: results.summary["controllers"][name].get("phases", ()) for name in order}
    return {name: phases for name, phases in found.items() if phases}


def _words(text: str) -> Cell:
    return Cell(text, text.replace(" -", " −"))
