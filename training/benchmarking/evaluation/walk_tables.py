"""Tables of controllers that walk: by command, and by the phase of a push."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from rich.markup import escape
from rich.table import Table

from poise.training.running.columns import COSTS, FALLS, FOLLOWED, J50, NONE, STEPS, Figure, known
from poise.training.running.summary import PhaseJ50, Summary, WalkLevel


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


def _levels(name: str, levels: Sequence[WalkLevel], figures: Sequence[Figure]) -> Table:
    table = Table(title=escape(name), title_justify="left")
    table.add_column("command", overflow="fold")
    for each in figures:
        table.add_column(escape(each.heading), justify="right", overflow="fold")
    for level in levels:
        table.add_row(escape(level["level"]), *(escape(each.text(level)) for each in figures))
    return table


def _phases(phases: dict[str, list[PhaseJ50]]) -> Table:
    table = Table(title="J50 [N·s] by phase of the stride, 0: the left foot lands",
                  title_justify="left")  # fmt: skip
    table.add_column("controller", overflow="fold")
    middles = sorted({entry["phase"] for found in phases.values() for entry in found})
    for middle in middles:
        table.add_column(f"{middle:.3f}", justify="right", overflow="fold")
    alone = replace(J50, ends="")
    for name, found in phases.items():
        own = {entry["phase"]: alone.text(entry) for entry in found}
        table.add_row(escape(name), *(own.get(middle, NONE) for middle in middles))
    return table
