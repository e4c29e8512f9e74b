"""The ranking in the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.training.evaluation.seed_groups import seed_lines


def print_benchmark(summary: Mapping[str, Any], console: Console) -> None:
    """Ranking, and what happened besides: errors, groups of training seeds."""
    robot = summary["robot"]["name"]
    title = escape(f"{summary['suite']} · {robot} · seed {summary['seed']}")
    table = Table(title=title, title_justify="left")
    for name, justify in COLUMNS:
        table.add_column(name, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for cells in ranking_rows(summary):
        table.add_row(*(escape(cell) for cell in cells))
    console.print(table)
    for line in seed_lines(summary["seeds"]):
        console.print(line, markup=False, highlight=False)
    for name, entry in summary["controllers"].items():
        if entry["errors"]:
            console.print(f"[red]{escape(name)} raised an error in {entry['errors']} trials[/red]")


COLUMNS = (
    ("controller", "left"),
    ("mean J50 [N·s]", "right"),
    ("η mean", "right"),
    ("η worst", "right"),
    ("recovered of the mix", "right"),
    ("lost, won", "right"),
    ("McNemar p", "right"),
    ("root [N]", "right"),
    ("tick [µs]", "right"),
)


def ranking_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """A row of texts per controller, best first; intervals are 95 %."""
    pairs = {pair["b"]: pair.get("mix") for pair in summary["pairs"]}
    rows = []
    for name in summary["ranking"]:
        entry = summary["controllers"][name]
        mix, pair = entry.get("mix"), pairs.get(name)
        rows.append([
            name,
            with_range(entry["j50_mean"], entry["j50_mean_ci95"], ".1f") + _bounds(entry),
            with_range(entry["eta_mean"], entry["eta_mean_ci95"], ".2f"),
            f"{entry['eta_min']:.2f}",
            with_range(mix["recovered_rate"], mix["recovered_ci95"], ".0%") if mix else "–",
            f"{pair['only_a']}, {pair['only_b']}" if pair else "–",
            f"{pair['p_mcnemar']:.2g}" if pair else "–",
            f"{entry['root_force_max']:.0f}",
            "–" if entry["tick_us"] is None else f"{entry['tick_us']:.0f}",
        ])  # fmt: skip
    return rows


def with_range(value: float, interval: Any, form: str) -> str:
    """A value with its interval."""
    low, high = (format(end, form) if end is not None else "–" for end in interval)
    return f"{value:{form}} [{low}, {high}]"


def _bounds(entry: Mapping[str, Any]) -> str:
    """A mark where the pushes did not reach from recovery to fall in every direction."""
    return f" ({entry['j50_bounded']} bounds)" if entry["j50_bounded"] else ""
