"""The leaderboard page, generated from a committed summary.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from poise.envs.config import write_atomic

from ..seed_groups import seed_lines
from .reading import read_summary
from .table import COLUMNS, ranking_rows

HEAD = """# Leaderboard

<!-- Written by `poise leaderboard {source}`: change the result, not this page. -->

Suite `{suite}`, robot `{robot}`, seed {seed}; Poise {poise}, MuJoCo {mujoco}, commit `{commit}`;
{processor}, {cores} cores. Intervals are 95 %; what the columns mean: [benchmark.md](benchmark.md).
`lost, won` and McNemar's p are against `{reference}` on the mix. `root [N]` is the largest
force that a controller took from nowhere: only those with 0 obey physics.

"""


def write_leaderboard(source: str | Path, page: str | Path) -> None:
    """Write the page from a summary.json of `poise benchmark`, or a folder that holds one.

    Raises ConfigError for another file, PoiseError when the page cannot be written.
    """
    path = Path(source)
    path = path / "summary.json" if path.is_dir() else path
    write_atomic(page, leaderboard(read_summary(path), str(source)))


def leaderboard(summary: Mapping[str, Any], source: str) -> str:
    """The page as Markdown."""
    versions, machine = summary["versions"], summary["machine"]
    text = HEAD.format(
        source=source,
        suite=summary["suite"],
        robot=summary["robot"]["name"],
        seed=summary["seed"],
        poise=versions.get("poise"),
        mujoco=versions.get("mujoco"),
        commit=(summary["commit"] or "unknown")[:10],
        processor=machine["processor"],
        cores=machine["cores"],
        reference=summary["reference"],
    )
    text += _table(["", *(name for name, _ in COLUMNS)], _ranked(summary))
    if lines := seed_lines(summary["seeds"]):
        text += "\n" + "\n".join(f"- {line}" for line in lines) + "\n"
    directions = _directions(summary)
    text += "\nη per direction (0° is forward, 90° left):\n\n" + _table(*directions)
    factors = _factors(summary)
    if factors is not None:
        text += "\nRecovered rate per level of a factor, all else standard:\n\n" + _table(*factors)
    return text


def _ranked(summary: Mapping[str, Any]) -> list[list[str]]:
    rows = ranking_rows(summary)
    return [[str(place), f"`{row[0]}`", *row[1:]] for place, row in enumerate(rows, 1)]


def _directions(summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    entries = summary["controllers"]
    angles = [d["direction"] for d in entries[summary["ranking"][0]]["directions"]]
    rows = [
        [f"`{name}`", *(f"{d['eta']:.2f}" for d in entries[name]["directions"])]
        for name in summary["ranking"]
    ]
    return ["controller", *(f"{angle:g}°" for angle in angles)], rows


def _factors(summary: Mapping[str, Any]) -> tuple[list[str], list[list[str]]] | None:
    names, entries = summary["ranking"], summary["controllers"]
    rows = []
    for k, factor in enumerate(entries[names[0]]["factors"]):
        for i, level in enumerate(factor["levels"]):
            here = [entries[name]["factors"][k]["levels"][i] for name in names]
            mark = " (standard)" if level["standard"] else ""
            rates = (f"{cell['recovered_rate']:.0%}" for cell in here)
            rows.append([factor["factor"], f"{level['level']}{mark}", *rates])
    return (["factor", "level", *(f"`{name}`" for name in names)], rows) if rows else None


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [_line(head), "|" + "---|" * len(head), *(_line(row) for row in rows)]
    return "\n".join(lines) + "\n"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
