"""Tables of walks, motions and levels: by command, by the phase of a push, by motion, by level."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from rich.markup import escape
from rich.table import Table

from poise.training.running.columns import (
    AT_LEVEL,
    COSTS,
    FALLS,
    FELL,
    FOLLOWED,
    IN_MOTION,
    J50,
    NONE,
    PERFORMED,
    STEPS,
    TRIED,
    Figure,
    known,
)
from poise.training.running.summary import InMotion, MotionLevel, PhaseJ50, Summary, WalkLevel

ALL = "all"  # motions of a suite
MEAN = "mean of the motions"


def walk_tables(summary: Summary) -> Iterator[Table]:
    """Three of the levels of each controller, and one of J50 by phase; as far as there are any."""
    entries = summary["controllers"]
    for name in summary["ranking"]:
        levels = entries[name].get("walks", [])
        as_told = replace(FALLS[-1], ends="")  # there is no room for its interval
        for figures in ((*FALLS[1:-1], as_told, *FOLLOWED), STEPS, COSTS):
            if shown := known(figures, levels):
                yield _levels(name, levels, shown)
    phases = {name: entries[name].get("phases", []) for name in summary["ranking"]}
    if any(phases.values()):
        yield _phases(phases)


def motion_tables(summary: Summary) -> Iterator[Table]:
    """One of the levels of each controller, one of all J50s in motion; as far as there are any."""
    entries = summary["controllers"]
    for name in summary["ranking"]:
        if levels := entries[name].get("motions"):
            yield _motions(name, levels)
    found = {name: rows for name in summary["ranking"] if (rows := entries[name].get("in_motion"))}
    if found:
        yield _in_motion(found)


def level_tables(summary: Summary) -> Iterator[Table]:
    """One of all controllers at each level of realism, if the suite has any."""
    entries = summary["controllers"]
    rows = [
        (name, level) for name in summary["ranking"] for level in entries[name].get("levels", ())
    ]
    if figures := known(AT_LEVEL, [level for _, level in rows]):
        table = _table("at levels of realism", figures, "controller", "level")
        for name, level in rows:
            texts = (escape(each.text(level)) for each in figures)
            table.add_row(escape(name), escape(level["level"]), *texts)
        yield table


def _table(title: str, figures: Sequence[Figure], *first: str) -> Table:
    """Of columns that say whose the figures are, and of figures, without rows."""
    table = Table(title=escape(title), title_justify="left")
    for heading in first:
        table.add_column(escape(heading), overflow="fold")
    for each in figures:
        heading = each.heading.replace(" [", "\n[")  # so more of them have room
        table.add_column(escape(heading), justify="right", overflow="fold")
    return table


def _levels(name: str, levels: Sequence[WalkLevel], figures: Sequence[Figure]) -> Table:
    table = _table(name, figures, "command")
    for level in levels:
        table.add_row(escape(level["level"]), *(escape(each.text(level)) for each in figures))
    return table


def _phases(phases: Mapping[str, Sequence[PhaseJ50]]) -> Table:
    middles = sorted({entry["phase"] for found in phases.values() for entry in found})
    columns = [Figure("", f"{middle:.3f}", "") for middle in middles]
    title = f"{J50.heading} by phase of the stride, 0: the left foot lands"
    table = _table(title, columns, "controller")
    alone = replace(J50, ends="")
    for name, found in phases.items():
        own = {entry["phase"]: alone.text(entry) for entry in found}
        table.add_row(escape(name), *(own.get(middle, NONE) for middle in middles))
    return table


def _motions(name: str, levels: Sequence[MotionLevel]) -> Table:
    figures = known(PERFORMED, levels)
    fell = replace(FELL, name="fell [95 %]")  # their number and the interval of the rate
    table = _table(name, [fell, *figures], "of J50", "motion")
    for level in levels:
        table.add_row(
            f"{level['share']:g}",
            escape(level["motion"] or ALL),
            escape(f"{FALLS[1].text(level)} {FELL.range(level)}"),
            *(escape(each.text(level)) for each in figures),
            end_section=level["motion"] is None,
        )
    return table


def _in_motion(found: Mapping[str, Sequence[InMotion]]) -> Table:
    """J50 in motion over that of standing."""
    figures = (TRIED[0], *IN_MOTION[2:])
    table = _table("J50 in motion", figures, "controller", "motion")
    for name, rows in found.items():
        for row in rows:
            texts = (escape(each.text(row)) for each in figures)
            table.add_row(escape(name), escape(row["motion"] or MEAN), *texts)
    return table
