"""A result for people: tables in the terminal, what their words mean, rows of the leaderboard."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.baselines.allowance import named
from poise.training.benchmarking.diagnosis.words import told_losses
from poise.training.benchmarking.metrics.seed_groups import seed_lines
from poise.training.motion.following.motion_tables import motion_tables
from poise.training.running.summary import Entry, Interval, Summary
from poise.training.running.terminal import BESIDE, in_parts

from .walk_tables import walk_tables

NONE = "–"
ROOT_FORCE = 1.0  # [N] more than a numerical residual
HALF_AT, P_VALUE, STEPS = "half at", "McNemar p", "steps, mean"
FAILURES = "solver failures"  # this and those above are headings that are explained
SEPARATED = 0.05  # p below which the trials separate two controllers
SHOWN = 5  # lost trials of a controller that are listed
IN_PAIRS = ("lost, won", P_VALUE)  # headings whose figures the table of pairs has
BOUNDS = {None: "", "lower": "≥ ", "upper": "≤ "}


def ranked(entries: Mapping[str, Entry]) -> list[str]:
    """Controllers, the best first: by mean J50, else by the fraction of the limit, else by rate.

    Those that took a force from nowhere come last.
    """
    key = _measure(entries)[0]
    return sorted(entries, key=lambda name: (assisted(entries[name]), -_value(entries[name], key)))


def places(entries: Mapping[str, Entry]) -> dict[str, int | None]:
    """The rank of each controller; those whose results print alike share one.

    None for those that took a force from nowhere.
    """
    key, form = _measure(entries)
    shown = {name: float(format(_value(entry, key), form))
             for name, entry in entries.items() if not assisted(entry)}  # fmt: skip
    better = {name: sum(other > value for other in shown.values()) for name, value in shown.items()}
    return {name: better[name] + 1 if name in better else None for name in entries}


def assisted(entry: Entry) -> bool:
    """True if a soft root took force from nowhere: what is recovered so is not comparable."""
    return (entry.get("root_force_max") or 0.0) > ROOT_FORCE


def _measure(entries: Mapping[str, Entry]) -> tuple[str, str]:
    """The key that controllers are ranked by, and the form in which it is printed."""
    for key, form in (("j50_mean", ".1f"), ("fraction50", ".2f")):
        if all(key in entry for entry in entries.values()):
            return key, form
    return "recovered_rate", ".2f"


def _value(entry: Entry, key: str) -> float:
    return float(entry[key])  # type: ignore[literal-required]


def print_summary(summary: Summary, console: Console) -> None:
    """Tables of the controllers and of the pairs, errors, a line per group of training seeds."""
    robot = summary["robot"]["name"]
    title = escape(f"{summary['suite']} · {robot} · seed {summary['seed']}")
    columns = [
        (heading, text)
        for heading, text in table_columns(summary)
        if heading not in IN_PAIRS
        and not {text(name) for name in summary["ranking"]} <= {NONE, "0"}
    ]
    names, rank = summary["ranking"], places(summary["controllers"])
    named = _room(names, 16)
    cells = {heading: [text(name) for name in names] for heading, text in columns}
    for k, part in enumerate(in_parts(cells, console.width - named - 2 * BESIDE - 3)):
        table = Table(title=None if k else title, title_justify="left")
        table.add_column("#", justify="right")
        table.add_column("controller", overflow="fold", width=named)
        for heading, width in part.items():
            table.add_column(heading, justify="right", overflow="fold", width=width)
        for name, row in zip(names, zip(*(cells[h] for h in part), strict=True), strict=True):
            table.add_row(str(rank[name] or NONE), escape(name), *row)
        console.print(table)
    for each in (*walk_tables(summary), *motion_tables(summary)):
        console.print(each)
    if summary["pairs"]:
        console.print(_pairs(summary, console.width))
    for line in _notes(summary, [heading for heading, _ in columns]):
        console.print(line, markup=False, highlight=False)
    for line in seed_lines(summary["seeds"]):
        console.print(line, markup=False, highlight=False)
    for name, entry in summary["controllers"].items():
        if entry["errors"]:
            console.print(f"[red]{escape(name)} raised an error in {entry['errors']} trials[/red]")


def _notes(summary: Summary, headings: Sequence[str]) -> list[str]:
    """What the tables' words mean, of those that are there."""
    notes = []
    if any(heading.startswith(HALF_AT) for heading in headings):
        notes.append(f"{HALF_AT}: half of the pushes that are this fraction of the "
                     f"{summary['scale']} are recovered; larger is better")  # fmt: skip
    if STEPS in headings:
        notes.append(f"{STEPS}: of all trials, those that were lost too")
    of_won = [e.get("solver_failures_recovered") for e in summary["controllers"].values()]
    if FAILURES in headings and None not in of_won:  # results of old have none
        notes.append(f"{FAILURES}: ticks of all trials, also of robots that were falling; "
                     f"{sum(filter(None, of_won))} in trials that were recovered")  # fmt: skip
    p_values = [pair["p_mcnemar"] for pair in summary["pairs"] if "p_mcnemar" in pair]
    if p_values:
        close = sum(p >= SEPARATED for p in p_values)
        notes.append(f"{P_VALUE} ≥ {SEPARATED:g}: these trials do not separate the two"
                     f" ({close} of {len(p_values)} pairs)")  # fmt: skip
    return notes


def print_lost(
    lost: Mapping[str, Sequence[int]],
    entries: Mapping[str, Entry],
    folder: Path,
    console: Console,
) -> None:
    """The numbers of trials that each controller has lost, why, and how to look at one of them.

    Args:
        lost: name → the numbers of the trials that it did not recover.
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
        command += [word for each in named(name) for word in ("--allow", each)]
        lines = [f"lost trials of {name}: {some}{more} ({shlex.join(command)})"]
        if told := told_losses(entries[name].get("losses", [])):
            lines.append(f"  {told}")
        for line in lines:
            console.print(line, markup=False, highlight=False, emoji=False, soft_wrap=True)


def table_columns(summary: Summary) -> list[tuple[str, Callable[[str], str]]]:
    """Headings, and the text of each for a controller; "–" where it has no such value."""
    entries = summary["controllers"]
    pairs = {p["b"]: p for p in summary["pairs"] if p["a"] == summary["reference"]}
    of_mix = f" of the {summary['rated']}" if summary["rated"] else ""

    def figure(form: Callable[[Entry], str]) -> Callable[[str], str]:
        """A text of the entry, where it has the keys."""

        def text(name: str) -> str:
            try:
                return form(entries[name])
            except KeyError:
                return NONE

        return text

    def lost(name: str) -> str:
        pair = pairs.get(name)
        return f"{pair['only_a']}, {pair['only_b']}" if pair and "only_a" in pair else NONE

    def p_value(name: str) -> str:
        pair = pairs.get(name)
        return f"{pair['p_mcnemar']:.2g}" if pair and "p_mcnemar" in pair else NONE

    return [
        ("mean J50 [N·s]", figure(
            lambda e: with_range(e["j50_mean"], e["j50_mean_ci95"], ".1f") + _bounds(e))),
        ("worst J50", figure(lambda e: f"{e['j50_min']:.1f}")),
        ("η mean", figure(lambda e: with_range(e["eta_mean"], e["eta_mean_ci95"], ".2f"))),
        ("η worst", figure(lambda e: f"{e['eta_min']:.2f}")),
        (f"{HALF_AT}, of {summary['scale']}", figure(
            lambda e: f"{BOUNDS[e['fraction50_bound']]}{e['fraction50']:.2f}")),
        (f"recovered{of_mix}", figure(
            lambda e: with_range(e["recovered_rate"], e["recovered_ci95"], ".0%"))),
        ("never fell", figure(_never_fell)),
        ("lost, won", lost),
        (P_VALUE, p_value),
        ("CoM drift [mm]", figure(lambda e: _number(e["com_drift_max"], ".1f", 1000.0))),
        ("feet drift [mm]", figure(lambda e: _number(e["foot_drift_max"], ".1f", 1000.0))),
        ("lean at the end [°]", figure(lambda e: _number(e["unpushed_lean_max"], ".2f"))),
        ("power [W]", figure(lambda e: _at_rest(e, e["mean_power_median"], ".0f"))),
        ("chatter [1/s]", figure(lambda e: _at_rest(e, e["torque_variation_median"], ".2f"))),
        (STEPS, figure(lambda e: _number(e["steps_mean"] or None, ".1f"))),
        ("of one-step limit", figure(lambda e: f"{e['step_share_1_mean']:.2f}")),
        (FAILURES, figure(lambda e: f"{e['solver_failures'] or NONE}")),
        ("of them in recoveries", figure(
            lambda e: f"{e['solver_failures_recovered']}" if e["solver_failures"] else NONE)),
        ("mean |action|", figure(lambda e: _number(e["mean_abs_action"] or None, ".3f"))),
        ("root [N]", figure(lambda e: _number(e["root_force_max"], ".0f"))),
        ("tick [µs]", figure(lambda e: _number(e["tick_us"], ".0f"))),
    ]  # fmt: skip


def _pairs(summary: Summary, width: int) -> Table:
    """For a console of this width, of which the figures need some 60 columns."""
    table = Table()
    titles = [f"{pair['b']} against {pair['a']}" for pair in summary["pairs"]]
    table.add_column(
        "b against a", overflow="fold", width=_room(titles, min(max(width - 60, 16), 34))
    )
    gain = any("j50_gain" in pair for pair in summary["pairs"])
    names = ["both", "only a (lost)", "only b (won)", "neither", P_VALUE]
    for name in names + (["J50 gain [95 %]"] if gain else []):
        table.add_column(name, justify="right", overflow="fold")
    for title, pair in zip(titles, summary["pairs"], strict=True):
        cells = [str(pair.get(key, NONE)) for key in ("both", "only_a", "only_b", "neither")]
        cells.append(_number(pair.get("p_mcnemar"), ".2g"))
        if gain:
            cells.append(with_range(pair.get("j50_gain"), pair.get("j50_gain_ci95"), "+.1%"))
        table.add_row(escape(title), *cells)
    return table


def with_range(value: float | None, interval: Interval | None, form: str) -> str:
    """A value with its interval."""
    low, high = (_number(end, form) for end in interval or (None, None))
    return NONE if value is None else f"{value:{form}} [{low}, {high}]"


def _never_fell(entry: Entry) -> str:
    """Shown where falls are what is counted: neither J50 nor a fraction of a limit is fitted."""
    if "j50_mean" in entry or "fraction50" in entry:
        return NONE
    return with_range(entry["never_fell_rate"], entry["never_fell_ci95"], ".1%")


def _bounds(entry: Entry) -> str:
    """A mark where the pushes did not reach from recovery to fall in every direction."""
    return f" ({entry['j50_bounded']} bounds)" if entry["j50_bounded"] else ""


def _number(value: float | None, form: str, scale: float = 1.0) -> str:
    return NONE if value is None else format(scale * value, form)


def _at_rest(entry: Entry, value: float | None, form: str) -> str:
    """A figure of robots that stand: of pushed ones it says more of the pushes."""
    return _number(value if entry["com_drift_max"] is not None else None, form)


def _room(names: Iterable[str], most: int) -> int:
    """Width of a column of names that are not to be cut, but for those longer than `most`."""
    return min(max(len(name) for name in names), most)
