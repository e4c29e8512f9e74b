"""Pictures of the benchmark: recovery envelope seen from above, fall probability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, cast

import numpy as np
from matplotlib.projections.polar import PolarAxes
from matplotlib.ticker import MaxNLocator, PercentFormatter
from numpy.typing import ArrayLike

from poise.training.benchmarking.statistics.fits import Bound, LogisticFit, check_trials, trial_bins
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.trials.step_limits import shown_out_to

from .style import GREY, INK, Look, legend_below, look, saved_figure

Unit = Literal["N·s", "N·s/kg", "fraction"]
Curve = tuple[ArrayLike, ArrayLike]  # directions [°], values
Band = tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]  # directions [°], values, low, high
IMPULSE_LABEL = {
    "N·s": "push impulse J [N·s]",
    "N·s/kg": "push impulse J/m [N·s/kg]",
    "fraction": "push impulse, as a fraction of the ankle limit",
}
IMPULSE_FORMAT = {"N·s": "{:.1f} N·s", "N·s/kg": "{:.3f} N·s/kg", "fraction": "{:.2f}"}
SIDES = {None: 0.0, "lower": 1.0, "upper": -1.0}  # of a bound: out or in is the true J50
ARROW = 0.11  # length of an arrow over the largest value that is drawn
RING_STEPS = [1, 2, 5, 10]
RING_LABELS = 33.75  # direction of the ring labels [°], between two of sixteen directions


def polar_envelope(
    path: str | Path,
    envelopes: Mapping[str, Band],
    *,
    ankle_limit: Curve | None = None,
    step_limits: Mapping[str, Curve] | None = None,
    bounds: Mapping[str, Sequence[Bound | None]] | None = None,
    note: str = "",
    title: str = "Recovered impulse by push direction",
    unit: str = "N·s",
) -> None:
    """J50 around the robot, seen from above: forward is up, left is left.

    Args:
        path: PNG file to write.
        envelopes: name → (directions [°], j50, low, high), four arrays of shape (n,). Directions
            count counter-clockwise from forward, in any order; [low, high] is drawn as a band.
        ankle_limit: (directions [°], limit), the impulse that the ankles alone can hold.
        step_limits: name → the same for what a number of steps can stop; far out it is cut off.
        bounds: name → what each j50 of its envelope is a bound of, see `LogisticFit.bound`. Bounds
            are hollow, with an arrow to the side where the true J50 is.
        note: a sentence below the title, of what is not drawn.
        title: above the plot.
        unit: of j50 and limit.

    Raises:
        ValueError: arrays of one entry differ in shape.
        PoiseError: the file cannot be written.
    """
    with saved_figure(path, 6.4, 7.0) as figure:
        ax = cast(PolarAxes, figure.add_subplot(projection="polar"))
        ax.set_theta_zero_location("N")
        ax.set_theta_direction(1)
        top, far = 0.0, [0.0]
        drawn: list[tuple[np.ndarray, np.ndarray, np.ndarray, Look]] = []
        if ankle_limit is not None:
            theta, (limit,) = _closed(*ankle_limit)
            ax.plot(theta, limit, color=INK, lw=1.3, ls=(0, (5, 3)), label="ankle limit", zorder=2)
            top = float(np.nanmax(limit))
        for k, (name, bound) in enumerate((step_limits or {}).items()):
            theta, (limit,) = _closed(*bound)
            dots = (0, (1, 1.5 + 1.5 * k))
            ax.plot(theta, limit, color=GREY, lw=1.3, ls=dots, label=name, zorder=2)
            far.append(float(np.nanmax(limit)))
        for k, (name, (directions, *values)) in enumerate(envelopes.items()):
            sides = [SIDES[bound] for bound in (bounds or {}).get(name, ())]
            theta, (j50, low, high, side) = _closed(
                directions, *values, sides or np.zeros(np.shape(directions))
            )
            style, known = look(k), np.isfinite(j50)
            ax.fill_between(theta, low, high, color=style.colour, alpha=0.2, lw=0, zorder=3)
            ax.plot(
                theta,
                j50,
                color=style.colour,
                ls=style.line,
                marker=style.marker,
                markevery=list(np.flatnonzero(side == 0)),
                label=name,
                zorder=4,
            )
            drawn.append((theta[known], j50[known], side[known], style))
            top = max([top, *j50[known], *high[known]])
        top = _draw_bounds(ax, drawn, top)
        top = shown_out_to(top, far)
        names = {0: "forward", 90: "left", 180: "backward", 270: "right"}
        angles = range(0, 360, 45)
        ax.set_thetagrids(angles, [f"{names.get(a, '')}\n{a}°".lstrip() for a in angles])
        ax.tick_params(axis="x", pad=9)
        rings = np.asarray(MaxNLocator(nbins=6, steps=RING_STEPS).tick_values(0, 1.01 * top or 1))
        rings = rings[rings > 0]
        ax.set_ylim(0, rings[-1])
        ax.set_rgrids(rings, [f"{r:g}" for r in rings], angle=RING_LABELS, color=GREY, size=9)
        for text in ax.get_yticklabels():
            text.set_bbox({"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.8})
        ax.spines["polar"].set_color("#CCCCCC")
        figure.suptitle(title)
        ax.set_title(
            f"J50 [{unit}]: half of the pushes are recovered. Band: 95 % interval."
            + (f"\n{note}" if note else ""),
            loc="center",
            color=GREY,
            size=10,
            weight="normal",
        )
        legend_below(figure)


def _draw_bounds(
    ax: PolarAxes, drawn: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, Look]], top: float
) -> float:
    """Hollow markers where J50 is a bound, with arrows to where the true one is.

    `top` is the largest radius that is drawn; returns what it is with the arrows.
    """
    length, ends = ARROW * top, [top]
    for theta, j50, side, style in drawn:
        for angle, radius, sign in zip(theta, j50, side, strict=True):
            if not sign:
                continue
            ends.append(max(radius + sign * length, 0.0))
            arrow = {"arrowstyle": "->", "color": style.colour, "lw": 1.4}
            ax.annotate("", (angle, ends[-1]), (angle, radius), arrowprops=arrow, zorder=5)
            ax.plot(angle, radius, color=style.colour, marker=style.marker, mfc="white", zorder=6)
    if len(ends) > 1:
        label = "hollow: only a bound"
        ax.plot([], [], color=GREY, ls="", marker="o", mfc="white", label=label)
    return max(ends)


def fall_probability(
    path: str | Path,
    trials: Mapping[str, tuple[ArrayLike, ArrayLike]],
    fits: Mapping[str, LogisticFit] | None = None,
    *,
    unit: Unit = "N·s",
    bins: int = 8,
    xlabel: str | None = None,
    title: str = "Pushes that are not recovered",
) -> None:
    """Fraction of trials that ended in a fall against the impulse, with the fitted curves.

    Dots are bins with about equally many trials each, bars their Wilson 95 % intervals, a line ends
    where the impulses end, and a tick on the 50 % line marks J50.

    Args:
        path: PNG file to write.
        trials: name → (impulse, recovered), two arrays of shape (n,).
        fits: name → fit of these trials. A fit whose J50 is only a bound has no curve.
        unit: of the impulse.
        bins: largest number of dots per controller; with at most as many distinct impulses, each of
            them is a bin.
        xlabel: instead of the label that belongs to the unit, as for another kind of fraction.
        title: above the plot.

    Raises:
        ValueError: trials that `fit_logistic` refuses too.
        PoiseError: the file cannot be written.
    """
    fits = fits or {}
    with saved_figure(path, 7.2, 4.8) as figure:
        ax = figure.add_subplot()
        ax.axhline(0.5, color=GREY, lw=0.8, ls=(0, (2, 3)), zorder=1)
        for k, (name, (impulse, recovered)) in enumerate(trials.items()):
            impulse, recovered = check_trials(impulse, recovered)
            style, fit, label = look(k), fits.get(name), name
            if fit is not None:
                sign = {None: "=", "lower": "≥", "upper": "≤"}[fit.bound]
                label = f"{name}: J50 {sign} {IMPULSE_FORMAT[unit].format(fit.j50)}"
            if fit is not None and fit.bound is None:
                x = np.linspace(impulse.min(), impulse.max(), 400)
                ax.plot(x, 1 - fit.probability(x), color=style.colour, ls=style.line, zorder=3)
                ax.plot(fit.j50, 0.5, color=style.colour, marker="|", ms=15, mew=2.5, zorder=4)
            # The same pushes make the same bins: set the controllers a little apart.
            shift = (k - (len(trials) - 1) / 2) * 0.006 * np.ptp(impulse)
            for i, (x_bin, fallen, count) in enumerate(trial_bins(impulse, recovered, bins)):
                rate, ci = fallen / count, wilson_interval(fallen, count)
                ax.errorbar(
                    x_bin + shift,
                    rate,
                    yerr=[[max(rate - ci.low, 0)], [max(ci.high - rate, 0)]],
                    color=style.colour,
                    marker=style.marker,
                    ls=style.line if fit is not None and fit.bound is None else "",
                    elinewidth=1.1,
                    capsize=2.5,
                    label=label if i == 0 else None,
                    zorder=5,
                )
        ax.set_ylim(-0.03, 1.03)
        ax.yaxis.set_major_formatter(PercentFormatter(1.0))
        ax.set_ylabel("trials not recovered (bars: 95 % interval)")
        ax.set_xlabel(xlabel or IMPULSE_LABEL[unit])
        ax.set_title(title)
        legend_below(figure, columns=2)


def _closed(directions: ArrayLike, *values: ArrayLike) -> tuple[np.ndarray, list[np.ndarray]]:
    """Directions in rising order [rad] and their values, with the first repeated at the end."""
    theta = np.radians(np.asarray(directions, dtype=float) % 360)
    rows = [np.asarray(value, dtype=float) for value in values]
    if any(row.shape != theta.shape or row.ndim != 1 or row.size == 0 for row in rows):
        shapes = [row.shape for row in rows]
        raise ValueError(f"directions {theta.shape} and values {shapes} must have one shape (n,)")
    order = np.argsort(theta)
    order = np.append(order, order[0])
    return np.append(theta[order[:-1]], theta[order[0]] + 2 * np.pi), [row[order] for row in rows]
