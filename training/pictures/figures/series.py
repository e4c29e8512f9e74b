"""The figures of one controller, and how their marks and intervals look in every picture."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from poise.training.benchmarking.statistics.rates import wilson_interval

from .page_svg import tag
from .palette import GREY
from .style import look

BOUNDS = {1.0: "at least ", -1.0: "at most ", 0.0: ""}  # side → prefix of a printed value
SIDES = {None: 0.0, "lower": 1.0, "upper": -1.0}  # of a bound: out or in is the true value
ARROW = 0.11  # length of an arrow over the largest value that is drawn


@dataclass(frozen=True, eq=False)
class Series:
    """The figures of one controller.

    Attributes:
        name, index: of the controller; the index chooses its look.
        x: directions [°], impulses, levels, (n,).
        y, low, high: the values there and their 95 % intervals, (n,); NaN where there is none.
        side: (n,) 1 where a value is only a lower bound, −1 where an upper one, else 0; all are 0
            if not given.

    Raises:
        ValueError: the arrays differ in shape.
    """

    name: str
    index: int
    x: np.ndarray
    y: np.ndarray
    low: np.ndarray
    high: np.ndarray
    side: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not self.side.size:
            object.__setattr__(self, "side", np.zeros(len(self.x)))
        shapes = [values.shape for values in (self.y, self.low, self.high, self.side)]
        if self.x.ndim != 1 or any(shape != self.x.shape for shape in shapes):
            raise ValueError(f"x {self.x.shape} and values {shapes} must have one shape (n,)")

    def text(self, k: int, form: str) -> str:
        """Return value number `k` as text, with its interval unless it is a bound."""
        found = f"{self.name}: {BOUNDS[self.side[k]]}{self.y[k]:{form}}"
        if self.has_interval(k):
            found += f" ({self.low[k]:{form}} to {self.high[k]:{form}})"
        return found

    def has_interval(self, k: int) -> bool:
        """Return whether value number `k` has an interval; that of a bound would contradict it."""
        return not self.side[k] and bool(np.isfinite(self.low[k]) and np.isfinite(self.high[k]))


def series(name: str, index: int, rows: Sequence[ArrayLike]) -> Series:
    """Return a series from any number of rows (x, y, low, high) or (x, y, low, high, side)."""
    columns = np.array(rows, dtype=float).reshape(len(rows), -1 if rows else 4).T
    return Series(name, index, *columns)


def rate_series(
    name: str, index: int, x: Sequence[float], counts: Sequence[tuple[int, int]]
) -> Series:
    """Return rates with Wilson intervals from (successes, trials) at each x."""
    return series(name, index, [
        (place, won / trials, *wilson_interval(won, trials))
        for place, (won, trials) in zip(x, counts, strict=True)
    ])  # fmt: skip


def draw_line(ax: Axes, s: Series, x: ArrayLike, y: ArrayLike, label: str) -> None:
    """The line of a series; its entry of the legend has the mark too."""
    style = look(s.index)
    ax.plot(x, y, color=style.colour, ls=style.line, marker=style.marker, markevery=[],
            label=label, zorder=4, gid=tag(s.index))  # fmt: skip


def draw_marks(
    ax: Axes, s: Series, tips: str, *, x: np.ndarray | None = None, across: bool = False,
    bars: bool = True, reach: float = 0.0,
) -> float:  # fmt: skip
    """Return the marks of a series, with the intervals as bars; bounds are hollow, with an arrow.

    Args:
        ax: of the picture; a polar one has x as its angle [rad].
        s: the series.
        tips: format of the values in the words that a page shows at a mark.
        x: the places of the marks, if they are not those of `s`.
        across: draw values to the right, places upwards.
        bars: whether intervals are drawn.
        reach: the largest value that is drawn; an arrow to where the true value is has a fixed
            part of this length.

    Returns the largest value that is drawn, with the arrows.
    """
    style, x, most = look(s.index), s.x if x is None else x, reach
    for k in np.flatnonzero(np.isfinite(s.y)).tolist():
        if bars and s.has_interval(k):
            bar = ax.hlines if across else ax.vlines
            bar(x[k], s.low[k], s.high[k], color=style.colour, lw=1.3, zorder=4,
                gid=tag(s.index, detail=True))  # fmt: skip
        fill, end = style.colour, s.y[k]
        if s.side[k]:
            fill, end = "white", max(s.y[k] + s.side[k] * ARROW * reach, 0.0)
            arrow = {"arrowstyle": "->", "color": style.colour, "lw": 1.4, "shrinkA": 0,
                     "shrinkB": 0, "gid": tag(s.index)}  # fmt: skip
            ax.annotate("", (x[k], end), (x[k], s.y[k]), arrowprops=arrow, zorder=5)
            most = max(most, end)
        place = (s.y[k], x[k]) if across else (x[k], s.y[k])
        ax.plot(*place, color=style.colour, marker=style.marker, mfc=fill, zorder=6,
                gid=tag(s.index, tip=s.text(k, tips)), clip_on=False)  # fmt: skip
    if s.side.any():
        ax.plot([], [], color=GREY, ls="", marker="o", mfc="white", label="hollow: only a bound")
    return most
