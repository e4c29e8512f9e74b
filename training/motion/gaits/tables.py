"""What a person reads of compared gaits."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .compare import GaitFigures

COLUMNS = (
    ("fell", lambda f: f"{f.falls} of {f.starts}"),
    ("speed [m/s]", lambda f: _text(f.speed_ahead, ".3f")),
    ("RMS error", lambda f: _text(f.speed_error_rms, ".3f")),
    ("CoT", lambda f: _text(f.cost_of_transport, ".2f")),
    ("of positive work", lambda f: _text(f.positive_cost_of_transport, ".2f")),
    ("knee [N·m/kg]", lambda f: _text(f.knee_mean, ".2f")),
    ("peak", lambda f: _text(f.knee_peak, ".2f")),
    ("RMSE to humans", lambda f: _text(f.knee_rmse, ".2f")),
    ("force peak [m g]", lambda f: _text(f.force_peak, ".2f")),
    ("height ± [mm]", lambda f: _text(f.height_amplitude, ".1f", 1e3)),
    ("J50 [N·s]", lambda f: _text(f.j50, ".1f")),
    ("tick [µs]", lambda f: _text(f.tick, ".0f")),
)


def print_gaits(figures: Sequence[GaitFigures], console: Console) -> None:
    """A table for each speed."""
    for speed in dict.fromkeys(each.speed for each in figures):
        table = Table(title=f"{speed:g} m/s", title_justify="left")
        table.add_column("controller", overflow="fold", min_width=11)
        own = [each for each in figures if each.speed == speed]
        shown = [(head, form) for head, form in COLUMNS if {form(each) for each in own} != {"–"}]
        for head, _ in shown:
            table.add_column(head, justify="right", overflow="fold")
        for each in own:
            table.add_row(escape(each.controller), *(form(each) for _, form in shown))
        console.print(table)


def _text(value: float | None, form: str, factor: float = 1.0) -> str:
    return "–" if value is None else format(factor * value, form)
