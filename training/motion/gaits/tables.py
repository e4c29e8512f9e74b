"""What a person reads of compared gaits."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.training.running.columns import Figure, known

from .compare import GaitFigures

#: of `GaitFigures`; a terminal has no room for longer names
COLUMNS = (
    Figure("falls", "fell", ".0f", of="starts"),
    Figure("speed_ahead", "speed", ".3f", "m/s"),
    Figure("speed_error_rms", "RMS error", ".3f"),
    Figure("cost_of_transport", "CoT", ".2f"),
    Figure("positive_cost_of_transport", "of positive work", ".2f"),
    Figure("knee_mean", "knee", ".2f", "N·m/kg"),
    Figure("knee_peak", "peak", ".2f"),
    Figure("knee_rmse", "RMSE to humans", ".2f"),
    Figure("force_peak", "force peak", ".2f", "m g"),
    Figure("height_amplitude", "height ±", ".1f", "mm", scale=1e3),
    Figure("j50", "J50", ".1f", "N·s"),
    Figure("tick", "tick", ".0f", "µs"),
)


def print_gaits(figures: Sequence[GaitFigures], console: Console) -> None:
    """A table for each speed."""
    for speed in dict.fromkeys(each.speed for each in figures):
        table = Table(title=f"{speed:g} m/s", title_justify="left")
        table.add_column("controller", overflow="fold", min_width=11)
        own = [vars(each) for each in figures if each.speed == speed]
        shown = known(COLUMNS, own)
        for column in shown:
            table.add_column(escape(column.heading), justify="right", overflow="fold")
        for each in own:
            table.add_row(escape(each["controller"]), *(column.text(each) for column in shown))
        console.print(table)
