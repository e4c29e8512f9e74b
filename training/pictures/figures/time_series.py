"""One trial over time."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter
from numpy.typing import ArrayLike

from poise.envs.viewing.quantities import CAPTURE_POINT, COM, COP, PUSH, Quantity

from .page_svg import tag
from .palette import GREY, INK, PALE, PURPLE, SERIES
from .style import Out, area_sample, headline, legend_below, sample, saved_figure

FAR = 0.3  # beyond the support, not shown [m]
LINES: dict[str, tuple[Quantity, Any, float]] = {  # signal → what it is, its dashes and width
    "capture_point": (CAPTURE_POINT, (0, (5, 1.2)), 2.0),
    "com": (COM, "-", 2.0),
    "cop": (COP, "-", 1.1),
}
SOLES: dict[str, Any] = {"fc": PALE, "alpha": 0.6, "ec": GREY, "lw": 0.8, "zorder": 0.1}
SHADE: dict[str, Any] = {"color": PUSH.hexadecimal, "alpha": 0.35, "lw": 0}  # of pushes
PANELS = {"angular_momentum": 2.2, "torque": 1.6}  # further signals → height of their panel
AXES: dict[str, tuple[str, Any]] = {  # of the angular momentum → colour, dashes
    "forward": (SERIES[6], "-"), "left": (SERIES[7], (0, (5, 2))), "up": (PURPLE, (0, (2, 2))),
}  # fmt: skip


def trial_timeseries(
    out: Out,
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    *,
    pushes: Sequence[tuple[float, float]] = (),
    title: str = "One trial",
) -> None:
    """CoM, CoP and capture point against the support, L, and how hard the motors work, in time.

    Args:
        out: PNG file to write, or a place in a page.
        t: (n,) time [s].
        signals: any of "com", "cop", "capture_point": (n, 2), forward and left in the heading frame
            [m]; "support": (n, 2, 2), extent of the support polygon, [:, axis, (low, high)] in the
            same frame [m]; "angular_momentum": (n, 3), about the CoM; forward, left and up
            [kg·m²/s]; "torque": (n,), largest |τ| / τ_max over the motors. NaN is a gap.
        pushes: (start, duration) of each push [s], shaded.
        title: above the plot.

    Raises:
        ValueError: an unknown signal.
        PoiseError: the file cannot be written.
    """
    known = {*LINES, "support", *PANELS}
    if unknown := set(signals) - known:
        raise ValueError(f"unknown signals {sorted(unknown)}, known: {sorted(known)}")
    t = np.asarray(t, dtype=float)
    data = {name: np.asarray(values, dtype=float) for name, values in signals.items()}
    panels = ["forward", "left", *(name for name in PANELS if name in data)]
    heights = [3.0, 3.0, *(PANELS[name] for name in panels[2:])]
    with saved_figure(out, 7.6, 0.9 + 0.72 * sum(heights)) as figure:
        axes = figure.subplots(len(panels), sharex=True, gridspec_kw={"height_ratios": heights})
        for panel, ax in zip(panels, axes, strict=True):
            if panel == "torque":
                _torque(ax, t, data["torque"])
            elif panel == "angular_momentum":
                _momentum(ax, t, data["angular_momentum"])
            else:
                _over_support(ax, panels.index(panel), t, data)
                ax.set_ylabel(f"{panel} [m]")
            shade_pushes(ax, pushes, t[-1])
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(t[0], t[-1])
        figure.align_ylabels()
        headline(figure, title)
        legend_below(figure)


def signal_keys() -> dict[str, Markup]:
    """name → look of what `trial_timeseries` draws, for a legend of a page."""
    keys = {quantity.label: sample(quantity.hexadecimal, style)
            for quantity, style, _ in LINES.values()}  # fmt: skip
    keys |= {"support": area_sample(**SOLES), "push": area_sample(**SHADE)}
    return keys | {f"L about {name}": sample(*look) for name, look in AXES.items()}


def shade_pushes(ax: Axes, pushes: Sequence[tuple[float, float]], end: float) -> None:
    """The time of each push, of (start, duration) [s], up to the end."""
    for start, duration in pushes:
        if start < end:
            ax.axvspan(
                start, min(start + duration, end), label="push", gid=tag(tip="push"), **SHADE
            )


def inside(ax: Axes, values: np.ndarray) -> np.ndarray:
    """Values with NaN for what lies outside of the axes, which nothing else cuts off."""
    low, high = ax.get_ylim()
    return np.where((low <= values) & (values <= high), values, np.nan)


def _over_support(ax: Axes, axis: int, t: np.ndarray, data: Mapping[str, np.ndarray]) -> None:
    _limit_view(ax, axis, data)
    if "support" in data:
        low, high = np.clip(data["support"][:, axis], *ax.get_ylim()).T
        ax.fill_between(t, low, high, label="support", **SOLES)
    for name, (quantity, style, width) in LINES.items():
        if name in data:
            ax.plot(t, inside(ax, data[name][:, axis]), ls=style, color=quantity.hexadecimal,
                    lw=width, label=quantity.label)  # fmt: skip


def _momentum(ax: Axes, t: np.ndarray, values: np.ndarray) -> None:
    for k, (name, (colour, style)) in enumerate(AXES.items()):
        ax.plot(t, values[:, k], color=colour, ls=style, lw=1.6, label=f"L about {name}")
    reach = 1.05 * float(np.nanmax(np.abs(values), initial=0.1))
    ax.set(ylim=(-reach, reach), ylabel="L [kg·m²/s]")


def _torque(ax: Axes, t: np.ndarray, values: np.ndarray) -> None:
    full = values >= 0.999
    if full.any():
        ax.fill_between(t, 0, 1, where=full, step="mid", color=GREY, alpha=0.35, lw=0,
                        label="motor at its limit")  # fmt: skip
    ax.plot(t, values, color=INK, lw=1.2)
    ax.set(ylim=(0, 1.05), ylabel="peak torque")
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))


def _limit_view(ax: Axes, axis: int, data: Mapping[str, np.ndarray]) -> None:
    """Keep a fall, metres away, from flattening what happened over the support."""
    values = {name: data[name][:, axis] for name in (*LINES, "support") if name in data}
    shown = np.concatenate([np.empty(0), *(series.ravel() for series in values.values())])
    if not np.isfinite(shown).any():
        return
    bottom, top = np.nanmin(shown), np.nanmax(shown)
    support = values.get("support", np.full((1, 2), np.nan))
    if np.isfinite(support).any():  # the first is of the posture: a fallen one lies on its hands
        first = support[np.isfinite(support).all(axis=1)][0]
        bottom = max(bottom, first[0] - FAR)
        top = min(top, first[1] + FAR)
    margin = 0.05 * max(top - bottom, 0.01)
    ax.set_ylim(bottom - margin, top + margin)
