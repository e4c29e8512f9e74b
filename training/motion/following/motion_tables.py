"""Tables of controllers that perform motions: falls and errors, and J50 in motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.markup import escape
from rich.table import Table

from poise.training.running.summary import InMotion, MotionLevel, Number, Summary

NONE = "–"
BOUNDS = {None: "", "lower": "≥ ", "upper": "≤ "}
ALL = "all"
STEPPED, OF_STEPS = "swing_error", ("swing_error", "placement_error", "support_slide")
#: heading → key of a level, factor, format
FIGURES: dict[str, tuple[str, float, str]] = {
    "joints \\[°]": ("joint_rms", float(np.degrees(1.0)), ".1f"),
    "bodies \\[mm]": ("body_error", 1e3, ".1f"),
    "from the root": ("body_error_root", 1e3, ".1f"),
    "last second": ("body_error_last", 1e3, ".1f"),
    "CoM \\[mm]": ("com_error", 1e3, ".1f"),
    "slide \\[mm]": ("sole_slide", 1e3, ".1f"),
    "late \\[s]": ("motion_delay", 1.0, ".2f"),
    "swing \\[mm]": ("swing_error", 1e3, ".1f"),
    "placed \\[mm]": ("placement_error", 1e3, ".1f"),
    "support \\[mm]": ("support_slide", 1e3, ".1f"),
    "steps": ("steps_mean", 1.0, ".1f"),
    "power \\[W]": ("mean_power", 1.0, ".0f"),
}


def motion_tables(summary: Summary) -> Iterator[Table]:
    """One of the levels of each controller, one of all J50s in motion; as far as there are any."""
    entries = summary["controllers"]
    for name in summary["ranking"]:
        if levels := entries[name].get("motions"):
            yield _levels(name, levels)
    found = {name: rows for name in summary["ranking"] if (rows := entries[name].get("in_motion"))}
    if found:
        yield _in_motion(found)


def _levels(name: str, levels: list[MotionLevel]) -> Table:
    table = Table(title=escape(name), title_justify="left")
    table.add_column("of J50", justify="right", overflow="fold")
    table.add_column("motion", no_wrap=True)
    for heading in ("fell \\[95 %]", *_headings(levels)):
        table.add_column(heading, justify="right", overflow="fold")
    shown = {heading: FIGURES[heading] for heading in _headings(levels)}
    for level in levels:
        low, high = (NONE if end is None else f"{end:.1%}" for end in level["fallen_ci95"])
        table.add_row(
            f"{level['share']:g}",
            escape(level["motion"] or ALL),
            f"{level['fallen']} of {level['trials']} \\[{low}, {high}]",
            *(_text(level.get(key), factor, form) for key, factor, form in shown.values()),
            end_section=level["motion"] is None,
        )
    return table


def _headings(levels: list[MotionLevel]) -> list[str]:
    """The columns; those of steps only where a motion has them."""
    stepped = any(level.get(STEPPED) is not None for level in levels)
    return [name for name, (key, _, _) in FIGURES.items() if stepped or key not in OF_STEPS]


def _in_motion(found: dict[str, list[InMotion]]) -> Table:
    """J50 in motion over that of standing."""
    table = Table(title="J50 in motion", title_justify="left")
    table.add_column("controller", overflow="fold")
    table.add_column("motion", no_wrap=True)
    for heading in ("trials", "of J50 \\[95 %]", "over standing \\[95 %]"):
        table.add_column(heading, justify="right", overflow="fold")
    for name, rows in found.items():
        for row in rows:
            sign = BOUNDS[row["share50_bound"]]
            share = sign + _ranged(row["share50"], row["share50_ci95"])
            ratio = NONE
            if row["over_standing"] is not None:
                ratio = sign + _ranged(row["over_standing"], row["over_standing_ci95"])
            motion = escape(row["motion"] or "mean of the motions")
            table.add_row(escape(name), motion, str(row["trials"]), share, ratio)
    return table


def _ranged(value: Number, ends: tuple[Number, Number] | None) -> str:
    low, high = (_text(end, 1.0, ".2f") for end in ends or (None, None))
    return f"{_text(value, 1.0, '.2f')} \\[{low}, {high}]"


def _text(value: object, factor: float, form: str) -> str:
    return format(factor * value, form) if isinstance(value, (int, float)) else NONE
