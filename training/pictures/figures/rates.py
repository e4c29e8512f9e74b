"""Rates: falls over the size of the push, recoveries at the levels of a factor; rows of values."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from numpy.typing import ArrayLike

from poise.training.benchmarking.statistics.fits import LogisticFit, check_trials, trial_bins

from .page_svg import tag
from .palette import GREY
from .series import Series, draw_line, draw_marks, rate_series
from .style import Out, headline, legend_below, look, saved_figure

SIZE = 7.2, 4.8  # [in]
BINS = 8


def fall_probability(
    out: Out,
    trials: Mapping[str, tuple[ArrayLike, ArrayLike]],
    fits: Mapping[str, LogisticFit] | None = None,
    *,
    bins: int = BINS,
    xlabel: str = "push impulse, as a fraction of the ankle limit",
    lost: str = "not recovered",
) -> None:
    """Fraction of trials that were lost against the impulse, with the fitted curves.

    Dots are bins with about equally many trials each, bars their Wilson 95 % intervals, a line ends
    where the impulses end, and a tick on the 50 % line marks J50.

    Args:
        out: PNG file to write, or a place in a page.
        trials: name → (fraction of a limit, recovered), two arrays of shape (n,).
        fits: name → fit of these trials. A fit whose J50 is only a bound has no curve.
        bins: largest number of dots per controller; with at most as many distinct impulses, each of
            them is a bin.
        xlabel: what the impulse is a fraction of.
        lost: what a trial is that is not recovered; of walks "fallen".

    Raises:
        ValueError: trials that `fit_logistic` refuses too.
        PoiseError: the file cannot be written.
    """
    fits = fits or {}
    with saved_figure(out, *SIZE) as figure:
        ax = _rates(figure, f"trials {lost}")
        ax.axhline(0.5, color=GREY, lw=0.8, ls=(0, (2, 3)), zorder=1)
        for k, (name, (impulse, recovered)) in enumerate(trials.items()):
            impulse, recovered = check_trials(impulse, recovered)
            style, fit, label = look(k), fits.get(name), name
            if fit is not None:
                sign = {None: "=", "lower": "≥", "upper": "≤"}[fit.bound]
                label = f"{name}: J50 {sign} {fit.j50:.2f}"
            x, y = np.zeros(0), np.zeros(0)
            if fit is not None and fit.bound is None:
                x = np.linspace(impulse.min(), impulse.max(), 100)
                y = 1.0 - fit.probability(x)
                ax.plot(fit.j50, 0.5, color=style.colour, marker="|", ms=15, mew=2.5, zorder=4,
                        gid=tag(k))  # fmt: skip
            # The same pushes make the same bins: set the controllers a little apart.
            shift = (k - (len(trials) - 1) / 2) * 0.006 * np.ptp(impulse)
            found = trial_bins(impulse, recovered, bins)
            s = rate_series(name, k, [b[0] for b in found], [b[1:] for b in found])
            draw_line(ax, s, x, y, label)
            draw_marks(ax, s, ".0%", x=s.x + shift)
        ax.set_xlabel(xlabel)
        headline(figure, f"Pushes after which a trial is {lost}", "Bars: 95 % intervals.")
        legend_below(figure, columns=2)


def level_curves(
    out: Out, series: Sequence[Series], levels: Sequence[str], standard: int | None = None
) -> None:
    """Recovery rate at every level of a factor; the standard level is shaded.

    Args:
        out: PNG file to write, or a place in a page.
        series: x counts the levels, y is the rate.
        levels: their names.
        standard: the number of the standard level.

    Raises PoiseError if the file cannot be written.
    """
    edge = 0.35
    with saved_figure(out, *SIZE) as figure:
        ax = _rates(figure, "recovered")
        if standard is not None:
            ax.axvspan(standard - edge, standard + edge, color=GREY, alpha=0.12, lw=0, gid=tag())
        for k, s in enumerate(series):
            shift = (k - (len(series) - 1) / 2) * min(0.02, 0.2 / len(series))
            draw_line(ax, s, s.x + shift, s.y, s.name)
            draw_marks(ax, s, ".0%", x=s.x + shift)
        ax.set_xlim(-edge, len(levels) - 1 + edge)
        ax.set_xticks(range(len(levels)), [shortened(level_text(level), 14) for level in levels])
        legend_below(figure)


def forest(out: Out, series: Sequence[Series], title: str, form: str) -> None:
    """One value with its interval for each controller, one under the other.

    Args:
        out: PNG file to write, or a place in a page.
        series: of one value each.
        title: what the values are, below them.
        form: format specification of the printed values.

    Raises PoiseError if the file cannot be written.
    """
    with saved_figure(out, 7.0, 0.8 + 0.45 * len(series)) as figure:
        ax = figure.add_subplot()
        for k, s in enumerate(series):
            draw_marks(ax, s, form, x=np.array([float(k)]), across=True)
        ax.set_yticks(range(len(series)), [shortened(s.name, 20) for s in series])
        ax.set_ylim(len(series) - 0.5, -0.5)
        ax.grid(False, axis="y")
        ax.set_xlabel(title)


def phase_curves(out: Out, series: Sequence[Series]) -> None:
    """J50 over the phase of the stride at which the push begins; bounds are hollow.

    Raises PoiseError if the file cannot be written.
    """
    with saved_figure(out, *SIZE) as figure:
        ax = figure.add_subplot()
        top = max(float(np.nanmax([s.y, s.high])) for s in series)
        for k, s in enumerate(series):
            shift = 0.007 * (k - (len(series) - 1) / 2)
            draw_line(ax, s, s.x + shift, s.y, s.name)
            top = max(top, draw_marks(ax, s, ".1f", x=s.x + shift, reach=top))
        ax.set(xlim=(0.0, 1.0), ylim=(0.0, 1.04 * top), ylabel="J50 [N·s]")
        ax.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
        ax.set_xlabel("phase: left foot lands at 0, right at 0.5")
        legend_below(figure)


def level_text(level: str) -> str:
    """Return a level for people: a number with a real minus, a name as it is."""
    return f"−{level[1:]}" if level.startswith("-") else level


def shortened(text: str, length: int) -> str:
    """Return the beginning of a long text."""
    return text if len(text) <= length else text[: length - 1] + "…"


def _rates(figure: Figure, title: str) -> Axes:
    """Axes from 0 to 100 %."""
    ax = figure.add_subplot()
    ax.set_ylim(-0.03, 1.03)
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))
    ax.set_ylabel(title)
    return ax
