"""What is found of a gait, the table of it, and the picture of [Zhao, fig. 12]."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console

from poise.training.pictures.figures.palette import GREY
from poise.training.pictures.figures.style import legend_below, look, saved_figure
from poise.training.running.columns import COSTS, FOLLOWED, J50_MEAN, TICK, Figure, known
from poise.training.running.tables import figure_table

from .knee_moment import POINTS, KneeMoment


@dataclass(frozen=True)
class GaitFigures:
    """A controller at one speed; means over its starts."""

    controller: str
    speed: float  #: the command [m/s]
    starts: int  #: how many walks there were
    falls: int  #: how many of them fell
    speed_ahead: float | None  #: that is reached [m/s]
    speed_error_rms: float | None  #: root mean square error of strides [m/s]
    cost_of_transport: float | None  #: see `Outcome`, as the next three
    positive_cost_of_transport: float | None
    knee_mean: float | None  #: of the stance knee on one foot, |τ|/m [N·m/kg]
    knee_peak: float | None
    knee_stance: float | None  #: mean |τ|/m over whole stances, on both feet too [N·m/kg]
    #: root mean square difference of the mean curve over stance from the human one [N·m/kg]
    knee_rmse: float | None
    force_peak: float | None  #: mean of the stances' largest vertical force, in m g
    height_amplitude: float | None  #: of the CoM in a step, half of its way up and down [m]
    step_length: float | None  #: [m]
    step_time: float | None  #: [s]
    #: (51,) mean τ/m over stance, extension positive [N·m/kg]; empty without stances
    knee_curve: tuple[float, ...]
    tick: float | None = None  #: median time of a control tick while it walks, from Python [µs]
    #: mean over directions and phases at 0.5 m/s [N·s]; None where it was not asked for
    j50: float | None = None


#: of `GaitFigures`; a terminal has no room for the longest names
COLUMNS = (
    Figure("falls", "fell", ".0f", of="starts"),
    FOLLOWED[0],
    FOLLOWED[3],
    replace(COSTS[0], name="CoT"),
    COSTS[1],
    replace(COSTS[2], name="knee"),
    replace(COSTS[3], unit=""),
    Figure("knee_rmse", "RMSE to humans", ".2f"),
    Figure("force_peak", "force peak", ".2f", "m g"),
    Figure("height_amplitude", "height ±", ".1f", "mm", scale=1e3),
    replace(J50_MEAN, key="j50", ends=""),
    replace(TICK, key="tick"),
)


def print_gaits(figures: Sequence[GaitFigures], console: Console) -> None:
    """A table for each speed."""
    for speed in dict.fromkeys(each.speed for each in figures):
        own = [vars(each) for each in figures if each.speed == speed]
        rows = (([each["controller"]], each) for each in own)
        table = figure_table(f"{speed:g} m/s", ["controller"], known(COLUMNS, own), rows)
        table.columns[0].no_wrap = True  # so that no name is broken
        console.print(table)


def stance_plot(path: Path, figures: Sequence[GaitFigures], band: KneeMoment) -> None:
    """The knee's torque over stance, models beside humans: a panel for each speed.

    Raises PoiseError if the file cannot be written.
    """
    speeds = sorted({each.speed for each in figures})
    names = list(dict.fromkeys(each.controller for each in figures))
    with saved_figure(path, 5.4 * len(speeds), 4.6) as figure:
        panels = figure.subplots(1, len(speeds), sharey=True, squeeze=False)[0]
        for ax, speed in zip(panels, speeds, strict=True):
            at = np.linspace(0.0, 100.0, POINTS)
            mean, half = band.curves()
            ax.fill_between(at, mean - half, mean + half, color=GREY, alpha=0.25, lw=0,
                            label="humans, coarse")  # fmt: skip
            for each in figures:
                if each.speed == speed and each.knee_curve:
                    style = look(names.index(each.controller))
                    ax.plot(at, each.knee_curve, color=style.colour, linestyle=style.line,
                            label=each.controller)  # fmt: skip
            ax.set_title(f"{speed:g} m/s")
            ax.set_xlabel("stance [%]")
        panels[0].set_ylabel("knee torque, extension [N·m/kg]")
        legend_below(figure, columns=3)
