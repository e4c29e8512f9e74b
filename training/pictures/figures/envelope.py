"""The recovery envelope, seen from above."""

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from poise.training.benchmarking.diagnosis.words import towards
from poise.training.benchmarking.trials.step_limits import shown_out_to

from .page_svg import tag
from .palette import GREY, INK
from .series import Series, draw_line, draw_marks
from .style import Out, headline, legend_below, look, saved_figure

Curve = tuple[ArrayLike, ArrayLike]  # directions [°], values
RING_STEPS = [1, 2, 5, 10]
RING_LABELS = 33.75  # direction of the ring labels [°], between two of sixteen directions
LIMIT = (0, (5, 3))  # dashes of the ankle limit


def step_dashes(k: int) -> tuple[float, tuple[float, float]]:
    """Dashes of the limit of step number k, from 0."""
    return 0, (1, 1.5 + 1.5 * k)


def polar_envelope(
    out: Out,
    series: Sequence[Series],
    *,
    ankle_limit: Curve | None = None,
    step_limits: Mapping[str, Curve] | None = None,
    marked: str | None = None,
    note: str = "",
    title: str = "Recovered impulse by push direction",
    unit: str = "N·s",
) -> None:
    """J50 around the robot, seen from above: forward is up, left is left.

    Args:
        out: PNG file to write, or a place in a page.
        series: x are directions, counter-clockwise from forward, in any order [°]; intervals are
            bands. Bounds are hollow, with an arrow to the side where the true J50 is.
        ankle_limit: (directions [°], limit), the largest impulse that ankles alone resist.
        step_limits: name → the same for what a number of steps can stop; far out it is cut off.
        marked: for a small picture of this one alone, without words, in which the others are faint.
        note: a sentence below the title, of what is not drawn.
        title: above the plot.
        unit: of the values and the limits.

    Raises:
        ValueError: the arrays of a curve differ in shape.
        PoiseError: the file cannot be written.
    """
    small = marked is not None
    width = 1.1 if small else 1.3  # of limits
    with saved_figure(out, 6.4, 6.4 if small else 7.0) as figure:
        ax = cast(PolarAxes, figure.add_subplot(projection="polar"))
        ax.set_theta_zero_location("N")
        shown = [s for s in series if not small or s.name == marked]
        reach = [value for s in series for value in (*s.y, *s.high) if np.isfinite(value)]
        if ankle_limit is not None:
            theta, limit = closed(*ankle_limit)
            ax.plot(theta, limit, color=INK, lw=width, ls=LIMIT, label="ankle limit", zorder=2)
            reach.append(np.nanmax(limit))
        top = float(max(reach, default=0.0))
        for s in series:
            theta, y = closed(s.x, s.y)
            if s not in shown:
                ax.plot(theta, y, color=GREY, lw=0.8, alpha=0.4, zorder=2)
                continue
            _, low = closed(s.x, s.low)
            _, high = closed(s.x, s.high)
            ax.fill_between(theta, low, high, color=look(s.index).colour, alpha=0.2, lw=0, zorder=3,
                            gid=tag(s.index, detail=not small))  # fmt: skip
            draw_line(ax, s, theta, y, s.name)
        ends = [top] if small else [
            draw_marks(ax, s, ".3g", x=np.radians(s.x), bars=False, reach=top) for s in shown
        ]  # fmt: skip
        limits = [closed(*curve) for curve in (step_limits or {}).values()]
        top = shown_out_to(max(ends, default=top), [float(np.nanmax(y)) for _, y in limits])
        rings = np.asarray(MaxNLocator(nbins=6, steps=RING_STEPS).tick_values(0, 1.01 * top or 1))
        rings = rings[rings > 0]
        for k, (name, (theta, limit)) in enumerate(zip(step_limits or {}, limits, strict=True)):
            limit = np.where(limit <= rings[-1], limit, np.nan)  # cut off, not bent
            ax.plot(theta, limit, color=GREY, lw=width, ls=step_dashes(k), label=name, zorder=2)
        ax.set_ylim(0, rings[-1])
        ax.spines["polar"].set_visible(False)
        angles = range(0, 360, 45)
        if small:
            ax.set_thetagrids(angles, [])
            ax.set_rgrids(rings, [])
            return
        ax.set_thetagrids(angles, [right_angle(angle) for angle in angles])
        ax.tick_params(axis="x", pad=9)
        texts = [*(f"{ring:g}" for ring in rings[:-1]), f"{rings[-1]:g} {unit}".rstrip()]
        ax.set_rgrids(rings, texts, angle=RING_LABELS, color=GREY, size=9)
        for text in ax.get_yticklabels():
            text.set_bbox({"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.8})
        said = f"J50 [{unit}]: half of the pushes are recovered. Band: 95 % interval."
        headline(figure, title, said, note, centred=True)
        legend_below(figure)


def right_angle(direction: float) -> str:
    """Return the name of a right angle, such as "left" for 90; degrees for all others."""
    angle = round(direction)
    return towards(angle) if angle in range(0, 360, 90) else f"{direction:g}°"


def closed(directions: ArrayLike, values: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Directions in rising order [rad] and their values, with the first repeated at the end.

    Raises ValueError if they are not of one shape (n,).
    """
    theta = np.radians(np.asarray(directions, dtype=float) % 360)
    row = np.asarray(values, dtype=float)
    if row.shape != theta.shape or row.ndim != 1 or row.size == 0:
        raise ValueError(
            f"directions {theta.shape} and values {row.shape} must have one shape (n,)"
        )
    order = np.argsort(theta)
    order = np.append(order, order[0])
    return np.append(theta[order[:-1]], theta[order[0]] + 2 * np.pi), row[order]
