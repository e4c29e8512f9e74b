"""Plots over time beside the scene, a line for each controller."""

from collections.abc import Sequence

import numpy as np
import viser
from viser import uplot

from poise.training.pictures.figures.style import look
from poise.training.pictures.sessions.frames import VALUES
from poise.training.pictures.sessions.live import Frames

WIDTH = 6.0  # [s] shown
HEIGHT = 150  # of a plot [pixels]
GREY = "#8A8A8A"  # of axes: seen on white and on black
FAINT = "rgba(138, 138, 138, 0.25)"
PADDING = (12, 8, 0, 0)  # above, right, below, left [pixels]: the highest number is seen whole
#: what a plot reaches up to at least: of a robot at rest it would show the noise alone
REACH = {"speed": 0.1, "margin": 0.1, "torque": 1.0, "push": 100.0}


class Plots:
    """The plots of `VALUES`; make it inside of the container that they are to stand in."""

    def __init__(self, gui: viser.GuiApi, names: Sequence[str]):
        self._names = names
        lines = (uplot.Series(label=name, stroke=look(k).colour, width=2.0, points={"show": False})
                 for k, name in enumerate(names))  # fmt: skip
        series = (uplot.Series(label="t [s]"), *lines)
        axis = uplot.Axis(stroke=GREY, grid={"stroke": FAINT}, ticks={"stroke": FAINT})
        empty = tuple(np.zeros(1) for _ in series)
        plots = {
            name: gui.add_uplot(
                empty, series, title=title, height=HEIGHT, axes=(axis, axis),
                scales={"x": uplot.Scale(time=False), "y": _scale(REACH[name])}, padding=PADDING,
                legend={"show": len(names) > 1 and k == 0, "live": False},
            )
            for k, (name, title) in enumerate(VALUES.items())
        }  # fmt: skip
        self._plots: dict[str, viser.GuiUplotHandle] = plots

    @property
    def handles(self) -> list[viser.GuiUplotHandle]:
        """viser's handles, in the order of `VALUES`."""
        return list(self._plots.values())

    def show(self, history: Sequence[Frames], at: int, period: float) -> None:
        """Draw what is up to frame `at`."""
        count = round(WIDTH / period)
        shown = history[max(at + 1 - count, 0) : at + 1]
        times = np.array([frames[0].time for frames in shown])
        for name, plot in self._plots.items():
            lines = (
                np.array([frames[k].values[name] for frames in shown])
                for k in range(len(self._names))
            )
            plot.data = (times, *lines)

    def remove(self) -> None:
        """Take them away."""
        for plot in self.handles:
            plot.remove()


def _scale(reach: float) -> uplot.Scale:
    """From 0 to `reach`, and as far beyond them as the lines go."""
    ends = {
        "min": {"soft": 0.0, "mode": 1, "pad": 0.1},
        "max": {"soft": reach, "mode": 1, "pad": 0.1},
    }
    return uplot.Scale(range=ends)
