"""The report's pictures of many controllers, as SVGs that follow the page's theme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from poise.training.benchmarking.statistics.fits import LogisticFit
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.trials.step_limits import shown_out_to

from .svg import Chart, Svg, colour, dash, right_angle, ticks

RADIUS, MIDDLE = 150.0, (200.0, 196.0)  # of the polar plot
SMALL = (312.0, 312.0)  # of one controller's own picture
ARROW = 11.0  # of a bound's mark, towards where the true value is
BOUNDS = {1: "at least ", -1: "at most ", 0: ""}  # side → how a value is told
OUT = 1.0 + 16.0 / RADIUS  # where the names of directions stand


@dataclass(frozen=True)
class Series:
    """The figures of one controller.

    Attributes:
        name, index: of the controller; the index chooses its look.
        x: directions [deg], impulses, levels.
        y, low, high: the values there and their 95 % intervals; NaN where there is none.
        side: 1 where a value is only a lower bound, −1 where an upper one, else 0; none: all are 0.
    """

    name: str
    index: int
    x: np.ndarray
    y: np.ndarray
    low: np.ndarray
    high: np.ndarray
    side: np.ndarray | None = None

    @property
    def sides(self) -> np.ndarray:
        """`side`, an entry for each value."""
        return np.zeros(len(self.x)) if self.side is None else self.side


def forest(series: Sequence[Series], title: str, form: str, scale: float = 1.0) -> Markup:
    """One value with its interval for each controller, one under the other; `x` is not used."""
    width, left, row = 420.0, 150.0, 26.0
    height = 34.0 + row * len(series) + 24.0
    values = [f"{s.name} {_with_ends(s, 0, form, scale)}" for s in series]
    svg = Svg(width, height, f"{title}: {'; '.join(values)}.")
    ends = np.concatenate([np.r_[s.y, s.low, s.high] for s in series]) * scale
    low, high = _padded(ends, 0.06)
    chart = Chart(svg, (left, 20.0, width - 14.0, height - 44.0), (low, high), (0.0, 1.0))
    for tick in ticks(low, high):
        x = float(chart.x(tick))
        svg.line(x, 12, x, height - 40, "grid")
        svg.text(x, height - 24, f"{tick:g}", "tick middle")
    svg.text((left + width - 14) / 2, height - 6, title, "axis middle")
    for k, s in enumerate(series):
        y = 26.0 + row * k
        with _series(svg, s):
            svg.text(left - 10, y + 4, _short(s.name, 20), "name end")
            if np.isfinite(s.low[0]):
                first, last = chart.x(np.array([s.low[0], s.high[0]]) * scale)
                svg.line(first, y, last, y, "whisker")
            svg.marker(float(chart.x(s.y[0] * scale)), y, s.index, values[k])
    return svg.render()


def polar(
    series: Sequence[Series],
    unit: str,
    limit: tuple[ArrayLike, ArrayLike] | None = None,
    marked: Series | None = None,
    steps: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
) -> Markup:
    """Values around the robot seen from above: forward is up, left is left.

    Args:
        series: `x` are directions, counter-clockwise from forward [deg].
        unit: of the values.
        limit: (directions [deg], value) of the ankle limit.
        marked: for a small picture of this one, in which the others are faint.
        steps: the same as `limit`, for what some steps can stop; far out it is cut off.
    """
    what = f"Recovered impulse [{unit}] by push direction"
    shown = [marked] if marked else series
    spans = "; ".join(f"{s.name} {np.nanmin(s.y):.3g} to {np.nanmax(s.y):.3g}" for s in shown)
    svg = Svg(*((400.0, 392.0) if marked is None else SMALL), f"{what}: {spans}.")
    middle = MIDDLE if marked is None else (SMALL[0] / 2, SMALL[1] / 2)
    tops = [np.nanmax(s.y) for s in series]
    if len(series) <= 4:
        tops += [np.nanmax(np.r_[s.high, s.y]) for s in series]
    if limit is not None:
        tops.append(float(np.max(np.asarray(limit[1]))))
    far = [float(np.max(np.asarray(values))) for _, values in (steps or {}).values()]
    most = shown_out_to(max(tops), far)
    rings = [tick for tick in ticks(0.0, 1.02 * most, 4) if tick > 0]
    top = max(1.02 * most, rings[-1])

    def place(directions: ArrayLike, values: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        angle = np.radians(np.asarray(directions, dtype=float))
        radius = np.minimum(np.asarray(values, dtype=float) / top, 1.0) * RADIUS
        return middle[0] - radius * np.sin(angle), middle[1] - radius * np.cos(angle)

    for ring in rings:
        svg.add("circle", cx=middle[0], cy=middle[1], r=RADIUS * ring / top, class_="grid")
    for angle in range(0, 360, 45):
        x, y = place(angle, top)
        svg.line(*middle, float(x), float(y), "grid")
        if marked is None:
            x, y = middle[0] + (x - middle[0]) * OUT, middle[1] + (y - middle[1]) * OUT
            side = "middle" if angle in (0, 180) else "end" if angle < 180 else ""
            svg.text(float(x), float(y) + 4, right_angle(angle), f"tick {side}")
    if limit is not None:
        svg.path(*place(*limit), "limit", close=True)
    for k, (angles, values) in enumerate((steps or {}).values(), 1):
        x, y = place(angles, np.where(np.asarray(values) <= top, values, np.nan))
        svg.path(np.append(x, x[0]), np.append(y, y[0]), f"steps n{k}")
    for s in series:
        x, y = place(s.x, s.y)
        if marked is not None and s.name != marked.name:
            svg.path(x, y, "faint", close=True)
    for s in shown:
        x, y = place(s.x, s.y)
        with _series(svg, s):
            if np.isfinite(s.low).all() and np.isfinite(s.high).all():
                outer, inner = place(s.x, s.high), place(s.x, s.low)
                loops = [np.append(a, a[0]) for a in (*outer, *inner)]
                with svg.group(class_="detail"):
                    svg.path(np.r_[loops[0], loops[2][::-1]], np.r_[loops[1], loops[3][::-1]],
                             "band", close=True)  # fmt: skip
            svg.path(x, y, "line", close=True, dash=dash(s.index))
            for k in range(len(x) if marked is None else 0):
                which = int(s.sides[k])
                tip = f"{s.name}, {s.x[k]:g}°: {BOUNDS[which]}{_with_ends(s, k, '.3g')} {unit}"
                if not which:
                    svg.marker(x[k], y[k], s.index, tip)
                    continue
                ray = np.array([x[k], y[k]]) - middle
                end = (x[k], y[k]) + which * ARROW * ray / max(float(np.hypot(*ray)), 1e-9)
                with svg.group(class_="bound"):
                    svg.line(x[k], y[k], float(end[0]), float(end[1]), "whisker")
                    svg.marker(x[k], y[k], s.index, tip)
    for ring in rings if marked is None else ():
        x, y = place(22.5, ring)
        svg.text(float(x), float(y) + 4, f"{ring:g}", "tick ring middle")
    return svg.render()


def fall_curves(
    series: Sequence[Series], fits: Mapping[str, LogisticFit], title: str, span: tuple[float, float]
) -> Markup:
    """Fraction of trials not recovered over the push: bins with their intervals, fitted curves.

    A fit whose J50 is only a bound has no curve. `span` is the range of pushes that were tried.
    """
    spans = "; ".join(
        f"{name} {'half at' if fit.bound is None else 'only a bound,'} {fit.j50:.2f}"
        for name, fit in fits.items()
    )
    svg = Svg(440.0, 320.0, f"Fraction of trials not recovered, over {title}: {spans}.")
    chart = Chart(svg, (44.0, 30.0, 428.0, 268.0), _padded(np.array(span), 0.03), (-0.02, 1.02))
    chart.y_axis(np.linspace(0, 1, 5).tolist(), ".0%", "not recovered")
    chart.x_axis(ticks(*span), "g", title)
    for k, s in enumerate(series):
        fit = fits.get(s.name)
        shift = (k - (len(series) - 1) / 2) * 1.6  # the same pushes make the same bins
        with _series(svg, s):
            if fit is not None and fit.bound is None:
                x = np.linspace(*span, 80)
                svg.path(chart.x(x), chart.y(1.0 - fit.probability(x)), "line", dash=dash(s.index))
            with svg.group(class_="detail" if fit is not None and fit.bound is None else None):
                _dots(svg, chart, s, shift)
    return svg.render()


def level_curves(
    series: Sequence[Series], levels: Sequence[str], title: str, standard: int | None = None
) -> Markup:
    """Recovery rate at every level of a factor; `x` counts the levels."""
    spans = "; ".join(
        f"{s.name} "
        + ", ".join(f"{levels[int(x)]}: {y:.0%}" for x, y in zip(s.x, s.y, strict=True))
        for s in series
    )
    svg = Svg(440.0, 296.0, f"Recovery rate over {title}: {spans}.")
    edge = 0.35
    chart = Chart(svg, (44.0, 30.0, 428.0, 268.0), (-edge, len(levels) - 1 + edge), (-0.02, 1.02))
    if standard is not None:
        left, right = chart.x([standard - edge, standard + edge])
        svg.add("rect", x=left, y=30, width=right - left, height=238, class_="standard")
    chart.y_axis(np.linspace(0, 1, 5).tolist(), ".0%", "recovered")
    chart.x_axis([])
    for k, level in enumerate(levels):
        svg.text(float(chart.x(k)), 285, _short(level_text(level), 14), "tick middle")
    for k, s in enumerate(series):
        shift = (k - (len(series) - 1) / 2) * min(3.0, 24.0 / len(series))
        with _series(svg, s):
            svg.path(chart.x(s.x) + shift, chart.y(s.y), "line", dash=dash(s.index))
            _dots(svg, chart, s, shift)
    return svg.render()


def level_text(level: str) -> str:
    """A level for people: a number with a real minus, a name as it is."""
    return f"−{level[1:]}" if level.startswith("-") else level


def rate_series(
    name: str, index: int, x: Sequence[float], counts: Sequence[tuple[int, int]]
) -> Series:
    """Rates with Wilson intervals from (successes, trials) at each x."""
    ends = [wilson_interval(*count) for count in counts]
    rates = np.array([won / trials for won, trials in counts])
    low, high = np.array(ends, dtype=float).reshape(-1, 2).T
    return Series(name, index, np.asarray(x, dtype=float), rates, low, high)


def _dots(svg: Svg, chart: Chart, s: Series, shift: float) -> None:
    """Marks with their intervals."""
    x, y, low, high = chart.x(s.x) + shift, chart.y(s.y), chart.y(s.low), chart.y(s.high)
    with svg.group(class_="detail"):
        for k in range(len(x)):
            if np.isfinite(low[k]):
                svg.line(x[k], low[k], x[k], high[k], "whisker")
    for k in range(len(x)):
        svg.marker(x[k], y[k], s.index, f"{s.name}: {_with_ends(s, k, '.0%')}")


def _series(svg: Svg, s: Series) -> AbstractContextManager[None]:
    """The group that the page shows, hides and brings to the front."""
    return svg.group(class_=f"series {colour(s.index)}", data_series=str(s.index))


def _with_ends(s: Series, k: int, form: str, scale: float = 1.0) -> str:
    text = format(s.y[k] * scale, form)
    if np.isfinite(s.low[k]) and np.isfinite(s.high[k]):
        text += f" ({format(s.low[k] * scale, form)} to {format(s.high[k] * scale, form)})"
    return text


def _padded(values: np.ndarray, fraction: float) -> tuple[float, float]:
    """The range of the finite values, a little wider; of nothing: 0 to 1."""
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    margin = fraction * (values.max() - values.min())
    return float(values.min() - margin), float(values.max() + margin)


def _short(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"
