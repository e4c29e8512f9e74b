"""An evaluation for people: plots, and tables in the terminal."""

from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .seed_groups import seed_lines


def print_summary(summary: Mapping[str, Any], console: Console) -> None:
    """Tables of the controllers and of the pairs, a line per group of training seeds."""
    title = escape(f"{summary['suite']} · {summary['robot']} · seed {summary['seed']}")
    console.print(_controllers(summary, title))
    if summary["pairs"]:
        console.print(_pairs(summary))
    for line in seed_lines(summary["seeds"]):
        console.print(line, markup=False, highlight=False)


def _controllers(summary: Mapping[str, Any], title: str) -> Table:
    entries = summary["controllers"]
    first = next(iter(entries.values()))
    table = Table(title=title, title_justify="left")
    table.add_column("controller", overflow="fold", min_width=_room(entries, 16))
    columns: list[tuple[str, Any]] = [
        ("recovered", lambda e: f"{e['recovered']}/{e['trials']}"),
        ("rate [95 %]", lambda e: _with_range(e, "recovered_rate", "recovered_ci95", ".1%")),
    ]
    if "j50_mean" in first:
        columns += [
            ("mean J50 [N·s]", lambda e: _with_range(e, "j50_mean", "j50_mean_ci95", ".1f")),
            ("worst J50", lambda e: f"{e['j50_min']:.1f}{_open(e)}"),
            ("η mean, min", lambda e: f"{e['eta_mean']:.2f}, {e['eta_min']:.2f}"),
        ]
    if "fraction50" in first:
        columns.append((f"half at, of {first['fraction_of']}", _half))
    if "j50_mean" not in first and "fraction50" not in first:
        rate = ("never_fell_rate", "never_fell_ci95", ".1%")
        columns.append(("never fell [95 %]", lambda e: _with_range(e, *rate)))
    if any(entry["com_drift_max"] is not None for entry in entries.values()):
        columns.append(("CoM drift [mm]", lambda e: _milli(e["com_drift_max"])))
    if any(entry["steps_max"] for entry in entries.values()):
        columns.append(("steps, mean", lambda e: _number(e["steps_mean"], ".1f")))
    if any("step_share_1_mean" in entry for entry in entries.values()):
        columns.append(("of one-step limit", _step_share))
    columns += [
        ("solver failures", lambda e: f"{e['solver_failures']}"),
        ("mean |action|", lambda e: _number(e["mean_abs_action"], ".3f")),
    ]
    for name, _ in columns:
        table.add_column(name, justify="right", overflow="fold")
    for name, entry in entries.items():
        table.add_row(escape(name), *(text(entry) for _, text in columns))
    return table


def _pairs(summary: Mapping[str, Any]) -> Table:
    table = Table()
    titles = [f"{pair['b']} against {pair['a']}" for pair in summary["pairs"]]
    table.add_column("b against a", overflow="fold", min_width=_room(titles, 34))
    names = ["both", "only a (lost)", "only b (won)", "neither", "McNemar p"]
    gain = "j50_gain" in summary["pairs"][0]
    for name in names + (["J50 gain [95 %]"] if gain else []):
        table.add_column(name, justify="right")
    for title, pair in zip(titles, summary["pairs"], strict=True):
        cells = [str(pair[key]) for key in ("both", "only_a", "only_b", "neither")]
        cells.append(f"{pair['p_mcnemar']:.2g}")
        if gain:
            cells.append(_with_range(pair, "j50_gain", "j50_gain_ci95", "+.1%"))
        table.add_row(escape(title), *cells)
    return table


def _room(names: Iterable[str], most: int) -> int:
    """Width of a column of names that are not to be cut, but for those longer than `most`."""
    return min(max(len(name) for name in names), most)


def _step_share(entry: Mapping[str, Any]) -> str:
    """J50 over the one-step limit, mean over the directions; others are in summary.json."""
    return _number(entry.get("step_share_1_mean"), ".2f")


def _half(entry: Mapping[str, Any]) -> str:
    sign = {None: "", "lower": "≥ ", "upper": "≤ "}[entry["fraction50_bound"]]
    return f"{sign}{entry['fraction50']:.2f}"


def _open(entry: Mapping[str, Any]) -> str:
    """A remark where the pushes did not reach from recovery to fall in every direction."""
    return f" ({entry['j50_bounded']} only bounds)" if entry["j50_bounded"] else ""


def _with_range(entry: Mapping[str, Any], value: str, interval: str, form: str) -> str:
    low, high = (_number(end, form) for end in entry[interval])
    return f"{_number(entry[value], form)} [{low}, {high}]"


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _milli(value: float | None) -> str:
    return "–" if value is None else f"{1000 * value:.1f}"
