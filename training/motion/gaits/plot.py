"""The picture of [Zhao, fig. 12]: the knee's torque over stance, models beside humans."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from poise.training.pictures.figures.palette import GREY
from poise.training.pictures.figures.style import legend_below, look, saved_figure

from .human import POINTS, KneeMoment

if TYPE_CHECKING:
    from .compare import GaitFigures


def stance_plot(path: Path, figures: Sequence[GaitFigures], band: KneeMoment) -> None:
    """One panel for each speed: the mean torque of the knee over stance, and the human band.

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
