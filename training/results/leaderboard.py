"""The leaderboard page, generated from committed files summary.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import is_folder
from poise.training.benchmark.table import COLUMNS, ranking_rows
from poise.training.evaluation.seed_groups import seed_lines

from .benchmark import read_summary
from .summary_form import shape

HEAD = """# Leaderboard

<!-- Written by `poise leaderboard {source}`: change the result, not this page. -->

Suite `{suite}`, robot `{robot}`, seed {seed}; Poise {poise}, MuJoCo {mujoco}, commit `{commit}`;
{processor}, {cores} cores. Intervals are 95 %; what the columns mean: [benchmark.md](benchmark.md).
`lost, won` and McNemar's p are against `{reference}` on the mix. `root [N]` is the largest
force that a controller took from nowhere: only those with 0 obey physics.

"""


SAME = ("suite", "seed", "robot", "reference")  # of results whose rows may stand in one table


def write_leaderboard(sources: Sequence[str | Path], page: str | Path) -> None:
    """Write the page from files summary.json of `poise benchmark`, or folders that hold one.

    Raises ConfigError for another file, or of another suite, seed, robot or reference than the
    first; PoiseError when the page cannot be written.
    """
    summaries = {}
    for source in sources:
        path = Path(source)
        path = path / "summary.json" if is_folder(path) else path
        summaries[str(source)] = read_summary(path)
    write_atomic(page, leaderboard(summaries))


def merged(summaries: Mapping[str, Mapping[str, Any]]) -> tuple[dict[str, Any], dict[str, str]]:
    """The first result with the rows of later ones; and whose result each row is.

    A controller of a later result takes the place of an earlier one of its name; the reference
    stays that of the first.
    """
    (first, summary), *later = summaries.items()
    whole = dict(summary)
    entries, origin = dict(whole["controllers"]), dict.fromkeys(whole["controllers"], first)
    pairs = {pair["b"]: pair for pair in whole["pairs"]}
    for source, other in later:
        for key in SAME:
            if other[key] != whole[key]:
                raise ConfigError(f"is not that of {first}", source=source, field=key)
        names = [name for name in other["controllers"] if name != whole["reference"]]
        for name in names:
            if shape(other["controllers"][name]) != shape(entries[whole["reference"]]):
                raise ConfigError(f"has other directions or levels than {first}", source=source,
                                  field=f"controllers.{name}")  # fmt: skip
            entries[name], origin[name] = other["controllers"][name], source
            pairs.pop(name, None)
        pairs |= {pair["b"]: pair for pair in other["pairs"] if pair["b"] in names}
    whole["controllers"], whole["pairs"] = entries, list(pairs.values())
    whole["ranking"] = sorted(entries, key=lambda name: -entries[name]["j50_mean"])
    return whole, origin


def leaderboard(summaries: Mapping[str, Mapping[str, Any]]) -> str:
    """The page as Markdown; `summaries` by where they come from."""
    summary, origin = merged(summaries)
    versions, machine = summary["versions"], summary["machine"]
    text = HEAD.format(
        source=" ".join(summaries),
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
    for source, other in list(summaries.items())[1:]:
        names = ", ".join(f"`{name}`" for name in summary["ranking"] if origin[name] == source)
        text += f"Played later, commit `{(other['commit'] or 'unknown')[:10]}`, "
        text += f"{other['machine']['processor']}, {other['machine']['cores']} cores: {names}.\n\n"
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
