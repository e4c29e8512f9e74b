"""Tables of walks, motions, levels and scenarios: by command, by phase, by motion, by name."""

from collections.abc import Iterator
from dataclasses import replace

from rich.table import Table

from poise.training.running.columns import (
    AT_LEVEL,
    COSTS,
    FALLS,
    FELL,
    FOLLOWED,
    GUSTS,
    IN_MOTION,
    J50,
    NONE,
    PERFORMED,
    STEPS,
    STOOD,
    SUSTAINED,
    TRIED,
    known,
)
from poise.training.running.summary import Summary
from poise.training.running.tables import figure_table, text_table
from poise.training.running.trial_figures import ScenarioFigures

ALL = "all"  # motions of a suite
MEAN = "mean of the motions"


def walk_tables(summary: Summary) -> Iterator[Table]:
    """Four of the levels of each controller, and one of J50 by phase; as far as there are any."""
    entries = summary["controllers"]
    for name in summary["ranking"]:
        levels = entries[name].get("walks", [])
        kicked = all(level["part"] == "walk_kick" for level in levels)  # named by their size
        for figures in (FALLS[1:], FOLLOWED, STEPS, COSTS):
            if shown := known(figures, levels):
                rows = (([level["level"]], level) for level in levels)
                yield figure_table(name, ["kick" if kicked else "command"], shown, rows)
    phases = {name: entries[name].get("phases", []) for name in summary["ranking"]}
    if any(phases.values()):
        middles = sorted({entry["phase"] for found in phases.values() for entry in found})
        alone = replace(J50, ends="")
        texts = {name: {entry["phase"]: alone.text(entry) for entry in found}
                 for name, found in phases.items()}  # fmt: skip
        yield text_table(
            f"{J50.heading} by phase of the stride, 0: the left foot lands",
            ["controller"], [f"{middle:.3f}" for middle in middles],
            ([name, *(own.get(each, NONE) for each in middles)] for name, own in texts.items()),
        )  # fmt: skip


def motion_tables(summary: Summary) -> Iterator[Table]:
    """One of the levels of each controller, one of all J50s in motion; as far as there are any."""
    entries = summary["controllers"]
    for name in summary["ranking"]:
        if levels := entries[name].get("motions"):
            figures = known(PERFORMED, levels)
            table = text_table(
                # of falls their number and the interval of the rate
                name, ["of J50", "motion"], ["fell [95 %]", *(each.heading for each in figures)],
                (
                    [f"{level['share']:g}", level["motion"] or ALL,
                     f"{FALLS[1].text(level)} {FELL.range(level)}",
                     *(each.text(level) for each in figures)]
                    for level in levels
                ),
            )  # fmt: skip
            for row, level in zip(table.rows, levels, strict=True):
                row.end_section = level["motion"] is None
            yield table
    rows = [
        ([name, row["motion"] or MEAN], row)
        for name in summary["ranking"]
        for row in entries[name].get("in_motion", ())
    ]
    if rows:
        yield figure_table("J50 in motion", ["controller", "motion"], (TRIED[0], *IN_MOTION[2:]),
                           rows)  # fmt: skip


def level_tables(summary: Summary) -> Iterator[Table]:
    """Yield a table of all controllers at each realism level, if the suite has any."""
    entries = summary["controllers"]
    rows = [
        ([name, level["level"]], level)
        for name in summary["ranking"]
        for level in entries[name].get("levels", ())
    ]
    if figures := known(AT_LEVEL, [level for _, level in rows]):
        yield figure_table("by realism level", ["controller", "level"], figures, rows)


def scenario_names(summary: Summary) -> list[str]:
    """Return the scenarios of all controllers, in the order of the suite."""
    entries = summary["controllers"].values()
    most = max(([each["scenario"] for each in entry.get("scenarios", ())] for entry in entries),
               key=len, default=[])  # fmt: skip
    others = (each["scenario"] for entry in entries for each in entry.get("scenarios", ()))
    return list(dict.fromkeys([*most, *others]))


def scenario_cell(found: ScenarioFigures | None) -> str:
    """Return the share of a scenario's trials without a fall."""
    return NONE if found is None else STOOD.text(found)


def scenario_tables(summary: Summary) -> Iterator[Table]:
    """One of all controllers and scenarios, if the suite has any."""
    if names := scenario_names(summary):
        rows = []
        for controller in summary["ranking"]:
            found = summary["controllers"][controller].get("scenarios", ())
            own = {each["scenario"]: each for each in found}
            rows.append([controller, *(scenario_cell(own.get(name)) for name in names)])
        yield text_table("without a fall", ["controller"], names, rows)


def lasting_tables(summary: Summary) -> Iterator[Table]:
    """One of pushes that last, one of gusts, as far as the suite has them."""
    entries = [(name, summary["controllers"][name]) for name in summary["ranking"]]
    if rows := [([name, own["profile"]], own) for name, entry in entries
                for own in entry.get("sustained", ())]:  # fmt: skip
        yield figure_table("sustained pushes", ["controller", "profile"], SUSTAINED, rows)
    if gusts := [([name], entry["gusts"]) for name, entry in entries if "gusts" in entry]:
        yield figure_table("gusts from one side", ["controller"], GUSTS, gusts)
