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
    Entry,
    Figure,
)
from poise.training.running.summary import both_ends

from .cells import CONTROLLER, Cell, Table, Text, entries_of, entry_table
from .plots import spans

PARTS = {"walk": "walk", "gait": "steps", "velocity": "course", "walk_push": "pushed",
         "walk_kick": "kicked", "walk_repeated": "pushed again and again",
         "terrains": "terrain"}  # fmt: skip
WALK = (CONTROLLER, Text("part", "part", "of the suite"),
        Text("level", "level", "commanded velocity, or the push"))  # fmt: skip
MOTION = Text("motion", "motion")


def walk_table(results: Results, order: Sequence[str]) -> Table | None:
    """Return every command of every controller: falls, and what was reached; None without walks."""
    caption = "What was reached of every command, pushed or not: means over trials."
    columns = (*WALK, *FALLS, *STEPS[:2], *FOLLOWED)
    return entry_table("walks", caption, columns, _walks(results, order))


def cost_table(results: Results, order: Sequence[str]) -> Table | None:
    """The steps of every command of every controller, and what they cost; None without walks."""
    caption = "Steps and their cost, means over trials."
    columns = (*WALK, *STEPS[2:], *COSTS)
    return entry_table("walk_costs", caption, columns, _walks(results, order))


def _walks(results: Results, order: Sequence[str]) -> list[Entry]:
    """Return an entry for each command."""
    return [
        {**each, "part": PARTS.get(each["part"], each["part"]), "level": _words(each["level"])}
        for each in entries_of(results, order, "walks")
    ]


def motion_table(results: Results, order: Sequence[str]) -> Table | None:
    """Return every motion and share of every controller; None where no motion was performed."""
    caption = "Falls and errors of every motion, by the share of J50 that it was pushed by."
    share = Figure("share", "push", "g", words="of the controller's J50")
    columns = (CONTROLLER, MOTION, share, *FALLS[:2], FELL, *PERFORMED)
    return entry_table("motions", caption, columns, _motions(results, order, "motions", ALL))


def in_motion_table(results: Results, order: Sequence[str]) -> Table | None:
    """J50 in each motion of every controller; None where nothing was pushed in motion."""
    caption = "J50 in motion over that of standing, over all directions."
    columns = (CONTROLLER, MOTION, *IN_MOTION)
    return entry_table("in_motion", caption, columns, _motions(results, order, "in_motion", MEAN))


def _motions(results: Results, order: Sequence[str], key: str, every: str) -> list[Entry]:
    """Return an entry for each motion; `every` names the entry over all motions."""
    return [
        {**each, "motion": _words(each["motion"] or every)}
        for each in entries_of(results, order, key)
    ]


def level_table(results: Results, order: Sequence[str]) -> Table | None:
    """Return all realism levels of all controllers; None if the suite has none."""
    caption = "The same initial states and pushes at each realism level."
    columns = (CONTROLLER, Text("level", "level", "of realism"), *AT_LEVEL)
    rows = [{**e, "level": _words(e["level"])} for e in entries_of(results, order, "levels")]
    return entry_table("levels", caption, columns, rows)


def phase_table(results: Results, order: Sequence[str]) -> Table | None:
    """J50 in each part of the stride; None where no walk was pushed."""
    caption = "J50 by the phase of the stride at which the push begins, over all directions."
    phase = Figure("phase", "phase", ".3f",
                   words="of the stride as the push begins: 0, the left foot lands")  # fmt: skip
    columns = (CONTROLLER, phase, *TRIED, J50)
    return entry_table("phases", caption, columns, entries_of(results, order, "phases"))


def phase_plot(results: Results, order: Sequence[str]) -> Markup | None:
    """J50 over the phase of the stride, with intervals; None where no walk was pushed."""
    entries = results.summary["controllers"]
    found = [
        series(name, results.controllers.index(name), [
            (each["phase"], each["j50"], *(both_ends(each["j50_ci95"]) or (np.nan, np.nan)),
             SIDES[each["j50_bound"]])
            for each in phases
        ])
        for name in order
        if (phases := entries[name].get("phases"))
    ]  # fmt: skip
    if not found:
        return None
    out = Inline(spans("J50 [N·s] over the phase of the stride", found, ".1f"))
    phase_curves(out, found)
    return out.svg


def _words(text: str) -> Cell:
    return Cell(text, text.replace(" -", " −"))
