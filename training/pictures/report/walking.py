"""What the report shows of walks, motions and levels: by command, by phase of a push, by motion."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from poise.training.benchmarking.evaluation.walk_tables import ALL, MEAN
from poise.training.benchmarking.results.read import Results
from poise.training.pictures.figures.rates import phase_curves
from poise.training.pictures.figures.series import SIDES, series
from poise.training.pictures.figures.style import Inline
from poise.training.running.columns import (
    AT_LEVEL,
    COSTS,
    FALLS,
    FELL,
    FOLLOWED,
    IN_MOTION,
    J50,
    PERFORMED,
    STEPS,
    TRIED,
    Figure,
)
from poise.training.running.summary import both_ends
from poise.training.running.trial_figures import PhaseJ50

from .cells import Cell, Column, Table, cell, figure_table
from .plots import spans

PARTS = {"walk": "walk", "gait": "steps", "velocity": "course", "walk_push": "pushed",
         "walk_kick": "kicked", "walk_repeated": "pushed again and again",
         "terrains": "terrain"}  # fmt: skip


def walk_table(results: Results, order: Sequence[str]) -> Table | None:
    """Every command of every controller: falls, and what was reached; None without walks."""
    caption = "What was reached of every command, pushed or not: means over trials."
    return _walks(results, order, "walks", caption, (*FALLS, *STEPS[:2], *FOLLOWED))


def cost_table(results: Results, order: Sequence[str]) -> Table | None:
    """The steps of every command of every controller, and what they cost; None without walks."""
    caption = "Steps and their cost, means over trials."
    return _walks(results, order, "walk_costs", caption, (*STEPS[2:], *COSTS))


def _walks(
    results: Results, order: Sequence[str], name: str, caption: str, figures: Sequence[Figure]
) -> Table | None:
    """A row for each command."""
    columns = [Column("part", "part", "of the suite"),
               Column("level", "level", "what it is told, or how it is pushed")]  # fmt: skip
    return figure_table(results, order, "walks", Table(name, caption, columns, []), figures,
                        lambda e: [_words(PARTS.get(e["part"], e["part"])),
                                   _words(e["level"])])  # fmt: skip


def motion_table(results: Results, order: Sequence[str]) -> Table | None:
    """Every motion and share of every controller; None where no motion was performed."""
    caption = "Falls and errors of every motion, by the share of J50 that it was pushed by."
    columns = [Column("motion", "motion"), Column("share", "push", "of the controller's J50")]
    return figure_table(results, order, "motions", Table("motions", caption, columns, []),
                        (*FALLS[:2], FELL, *PERFORMED),
                        lambda e: [_words(e["motion"] or ALL), cell(e["share"], "g")])  # fmt: skip


def level_table(results: Results, order: Sequence[str]) -> Table | None:
    """Every level of realism of every controller; None where the suite has none."""
    caption = "The same starts and pushes at each level of realism."
    table = Table("levels", caption, [Column("level", "level", "of realism")], [])
    return figure_table(results, order, "levels", table, AT_LEVEL, lambda e: [_words(e["level"])])


def in_motion_table(results: Results, order: Sequence[str]) -> Table | None:
    """J50 in each motion of every controller; None where nothing was pushed in motion."""
    caption = "J50 in motion over that of standing, over all directions."
    table = Table("in_motion", caption, [Column("motion", "motion")], [])
    return figure_table(results, order, "in_motion", table, IN_MOTION,
                        lambda e: [_words(e["motion"] or MEAN)])  # fmt: skip


def phase_table(results: Results, order: Sequence[str]) -> Table | None:
    """J50 in each part of the stride; None where no walk was pushed."""
    caption = "J50 by the phase of the stride at which the push begins, over all directions."
    columns = [Column("phase", "phase", "of the stride as the push begins: 0, the left foot lands")]
    return figure_table(results, order, "phases", Table("phases", caption, columns, []),
                        (*TRIED, J50), lambda e: [cell(e["phase"], ".3f")])  # fmt: skip


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
