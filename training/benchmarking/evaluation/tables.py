"""Tables of a result in the terminal, their notes, rows of the leaderboard."""

import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.baselines.allowance import allow_words
from poise.training.benchmarking.diagnosis.words import losses_text
from poise.training.benchmarking.metrics.seed_groups import seed_lines
from poise.training.benchmarking.trials.agents import code_of
from poise.training.running.columns import (
    AS_COMMANDED,
    AT_REST,
    ETA_MEAN,
    ETA_WORST,
    FAILURES,
    GAIN,
    J50_MEAN,
    J50_SCALED,
    J50_WORST,
    LOST_WON,
    NONE,
    NOT_FALLEN,
    P_VALUE,
    PAIRED,
    RECOVERED,
    ROBUST,
    STEPS_TAKEN,
    UP_AGAIN,
    known,
)
from poise.training.running.summary import Entry, Summary
from poise.training.running.tables import figure_table
from poise.training.running.terminal import PADDING, in_parts
from poise.training.running.trial_figures import NOT_FALLEN as CRITERION

from .walk_tables import lasting_tables, level_tables, motion_tables, scenario_tables, walk_tables

ROOT_FORCE = 1.0  # [N] more than a numerical residual
SEPARATED = 0.05  # p below which the trials separate two controllers
EARLY = "{} fell before the push in {} of {} trials, which count as lost"
NOT_CORRECTED = "; p is not corrected for their number"  # of several pairs
SHOWN = 5  # lost trials of a controller that are listed
IN_PAIRS = (LOST_WON.heading, P_VALUE.heading)  # headings whose figures the table of pairs has


def ranked(entries: Mapping[str, Entry]) -> list[str]:
    """Controllers, the best first: by mean J50, else by the fraction of the limit, else by rate.

    The rate is that of the trials without a fall where all walk, else that of recovered ones. Of
    equal ones the one with more recovered trials is first. Controllers with an external force at a
    soft root come last.
    """
    key = _measure(entries)[0]

    def order(name: str) -> tuple[bool, float, float]:
        entry = entries[name]
        return assisted(entry), -_value(entry, key), -entry["recovered_rate"]

    return sorted(entries, key=order)


def shared_ranks(
    entries: Mapping[str, Entry], measure: tuple[str, str] | None = None
) -> dict[str, int | None]:
    """Return the rank of each controller; equal printed results share one.

    None for those with an external force at a soft root, or without a value of the `measure`: a key
    and its print format, by default that of `ranked`.
    """
    key, form = measure or _measure(entries)
    shown = {name: float(format(_value(entry, key), form)) for name, entry in entries.items()
             if key in entry and not assisted(entry)}  # fmt: skip
    better = {name: sum(other > value for other in shown.values()) for name, value in shown.items()}
    return {name: better[name] + 1 if name in better else None for name in entries}


def assisted(entry: Entry) -> bool:
    """Return whether a soft root took an external force, so recovery is not comparable."""
    return (entry.get("root_force_max") or 0.0) > ROOT_FORCE


def _measure(entries: Mapping[str, Entry]) -> tuple[str, str]:
    """Return the key that controllers are ranked by, and the form in which it is printed."""
    for key, form in (("j50_mean", ".1f"), ("fraction50", ".2f")):
        if all(key in entry for entry in entries.values()):
            return key, form
    return ("never_fell_rate" if judged_by_falls(entries) else "recovered_rate"), ".2f"


def judged_by_falls(entries: Mapping[str, Entry]) -> bool:
    """Return whether all are judged by falls, see `Entry.criterion`."""
    return all(entry.get("criterion") == CRITERION for entry in entries.values())


def _value(entry: Entry, key: str) -> float:
    return float(entry[key])  # type: ignore[literal-required]


def print_summary(summary: Summary, console: Console) -> None:
    """Tables of the controllers and of the pairs, errors, a line per group of training seeds."""
    robot = summary["robot"]["name"]
    facts = [summary["suite"], robot, f"seed {summary['seed']}"]
    if "physics" in summary:
        facts.append(summary["physics"])
    title = escape(" · ".join(facts))
    cells = {
        heading: texts
        for heading, texts in table_cells(summary).items()
        if heading not in IN_PAIRS and not {*texts} <= {NONE, "0"}
    }
    names, rank = summary["ranking"], shared_ranks(summary["controllers"])
    named = _room(names, 16)
    for k, part in enumerate(in_parts(cells, console.width - named - 2 * PADDING - 3)):
        table = Table(title=None if k else title, title_justify="left")
        table.add_column("#", justify="right")
        table.add_column("controller", overflow="fold", width=named)
        for heading, width in part.items():
            table.add_column(escape(heading), justify="right", overflow="fold", width=width)
        for name, row in zip(names, zip(*(cells[h] for h in part), strict=True), strict=True):
            table.add_row(str(rank[name] or NONE), escape(name), *row)
        console.print(table)
    special = walk_tables, motion_tables, level_tables, scenario_tables, lasting_tables
    for each in (table for tables in special for table in tables(summary)):
        console.print(each)
    if summary["pairs"]:
        console.print(_pairs(summary, console.width))
    for line in (*_notes(summary, [*cells]), *seed_lines(summary["seeds"])):
        console.print(line, markup=False, highlight=False)
    for name, entry in summary["controllers"].items():
        if entry["errors"]:
            console.print(f"[red]{escape(name)} raised an error in {entry['errors']} trials[/red]")


def _notes(summary: Summary, headings: Sequence[str]) -> list[str]:
    """Return explanations of the headings in the tables."""
    notes = []
    if (half := replace(J50_SCALED, unit=f"× {summary['scale']}").heading) in headings:
        notes.append(f"{half}: half of the pushes of this size are recovered, with the 95 % "
                     "interval; larger is better")  # fmt: skip
    if judged_by_falls(summary["controllers"]):
        notes.append(f"J50, the order and pairs of walks are by falls; {NOT_FALLEN.name} is of the "
                     f"pushes common to all; {AS_COMMANDED.name}: the last two strides are as near "
                     "to the command as the controller's own before the push, within 0.05 m/s and "
                     "5 °/s")  # fmt: skip
    if STEPS_TAKEN.heading in headings:
        notes.append(f"{STEPS_TAKEN.heading}: of all trials, those that were lost too")
    of_won = [e.get("solver_failures_recovered") for e in summary["controllers"].values()]
    if FAILURES.heading in headings and None not in of_won:  # older results lack it
        notes.append(f"{FAILURES.heading}: ticks of all trials, also of robots that were falling; "
                     f"{sum(filter(None, of_won))} in trials that were recovered")  # fmt: skip
    p_values = [pair["p_mcnemar"] for pair in summary["pairs"] if "p_mcnemar" in pair]
    if p_values:
        close = sum(p >= SEPARATED for p in p_values)
        notes.append(
            f"{P_VALUE.heading} ≥ {SEPARATED:g}: these trials do not separate the two"
            f" ({close} of {len(p_values)} pairs{NOT_CORRECTED * (len(p_values) > 1)})"
        )
    for name, entry in summary["controllers"].items():
        if early := entry.get("fell_before_push"):
            notes.append(EARLY.format(name, early, entry["evaluated"]))
    return [*notes, *stand_in_notes(summary)]


def stand_in_notes(summary: Summary) -> list[str]:
    """Return a line for each controller that another one has replaced in some trials."""
    return [
        f"{name}: {other} ran in its place in {count} of {entry['evaluated']} trials, as the "
        f"controller's `uncertain` says for this realism"
        for name, entry in summary["controllers"].items()
        for other, count in entry.get("stand_ins", {}).items()
    ]


def print_lost(
    lost: Mapping[str, Sequence[int]],
    entries: Mapping[str, Entry],
    folder: Path,
    console: Console,
) -> None:
    """Print the numbers of each controller's lost trials, the causes, and a command to view one.

    Args:
        lost: name → the numbers of the trials that it did not recover, of walks those that fell.
        entries: of the summary.
        folder: of the result.
        console: where the lines are printed.
    """
    for name, numbers in lost.items():
        if not numbers:
            continue
        some = ", ".join(str(number) for number in numbers[:SHOWN])
        more = f", … ({len(numbers)})" if len(numbers) > SHOWN else ""
        command = ["poise", "view", str(folder), "--trial", str(numbers[0]), "--controllers", name]
        command += allow_words(code_of(name))
        lines = [f"lost trials of {name}: {some}{more} ({shlex.join(command)})"]
        if causes := losses_text(entries[name].get("losses", [])):
            lines.append(f"  {causes}")
        for line in lines:
            console.print(line, markup=False, highlight=False, emoji=False, soft_wrap=True)


def table_cells(summary: Summary) -> dict[str, list[str]]:
    """Heading → the text of each controller, in the order of the ranking; "–" where it has none."""
    pairs = {pair["b"]: pair for pair in summary["pairs"] if pair["a"] == summary["reference"]}
    entries = [summary["controllers"][name] for name in summary["ranking"]]
    rows = [{**summary["controllers"][name], **pairs.get(name, {})} for name in summary["ranking"]]
    rated = f", {summary['rated']}" if summary["rated"] else ""
    recovered = replace(RECOVERED, name=f"{RECOVERED.name}{rated}")
    rates = (recovered, NOT_FALLEN)
    if judged_by_falls(summary["controllers"]):
        rates = (NOT_FALLEN, AS_COMMANDED)
    figures = (
        *(J50_WORST, ETA_MEAN, ETA_WORST),
        replace(J50_SCALED, unit=f"× {summary['scale']}"),
        *rates,
        *UP_AGAIN,
        *(LOST_WON, P_VALUE, *AT_REST, STEPS_TAKEN, *ROBUST),
    )
    return {
        J50_MEAN.heading: [j50_mean_text(entry) for entry in entries],
        **{each.heading: [each.text(entry) for entry in rows] for each in figures},
    }


def j50_mean_text(entry: Entry) -> str:
    """With a mark where the pushes did not reach from recovery to fall in every direction."""
    bounded = entry.get("j50_bounded")
    return J50_MEAN.text(entry) + (f" ({bounded} bounds)" if bounded else "")


def _pairs(summary: Summary, width: int) -> Table:
    """For a console of this width, of which the figures need some 60 columns."""
    rows = [([f"{pair['b']} against {pair['a']}"], pair) for pair in summary["pairs"]]
    figures = (*PAIRED, P_VALUE, *known([GAIN], summary["pairs"]))
    table = figure_table("", ["b against a"], figures, rows)
    table.columns[0].width = _room((own[0] for own, _ in rows), min(max(width - 60, 16), 34))
    return table


def _room(names: Iterable[str], most: int) -> int:
    """Return the width of a column of names, at most `most`."""
    return min(max(len(name) for name in names), most)
