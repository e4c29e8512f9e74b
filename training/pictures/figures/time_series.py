"""Pictures over time: a training run, one trial."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, PercentFormatter
from numpy.typing import ArrayLike

from poise.envs.viewing.quantities import CAPTURE_POINT, COM, COP, PUSH, Quantity

from .style import GREY, INK, legend_below, look, saved_figure

FAR = 0.3  # beyond the support, not shown [m]


def training_curve(
    path: str | Path,
    rows: Sequence[Mapping[str, float]],
    *,
    x: str = "steps",
    baseline: float | None = None,
    title: str = "Training",
) -> None:
    """The course of a training run: recovery rates on top, a small panel for each other column.

    Args:
        path: PNG file to write.
        rows: one mapping per log entry with the column `x` and any others. Columns that end in
            "rate" are in [0, 1] and have the top panel in common; NAME_low and NAME_high are the
            band around NAME. An entry may lack a column (or hold NaN): evaluations are rarer than
            rollouts.
        x: column of the horizontal axis [environment steps].
        baseline: recovery rate of the baseline controller, drawn as a line.

    Raises:
        ValueError: no rows, or no column beside `x`.
        PoiseError: the file cannot be written.
    """
    columns = {
        name: np.array([row.get(name, np.nan) for row in rows], dtype=float)
        for name in dict.fromkeys(key for row in rows for key in row)
    }
    bands = {f"{name}{end}" for name in columns for end in ("_low", "_high")}
    names = [name for name in columns if name != x and name not in bands]
    if not names or x not in columns:
        raise ValueError(f"training_curve needs rows with the column '{x}' and at least one more")
    rates = [name for name in names if name.endswith("rate")]
    panels = ([rates] if rates else []) + [[name] for name in names if name not in rates]
    heights = [3.0 if panel is rates else 1.3 for panel in panels]
    with saved_figure(path, 7.2, 1.4 + sum(heights)) as figure:
        axes = figure.subplots(
            len(panels), sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
        )[:, 0]
        for ax, panel in zip(axes, panels, strict=True):
            for k, name in enumerate(panel):
                _series(ax, columns, x, name, k)
            if panel is rates:
                ax.set_ylim(-0.02, 1.02)
                ax.yaxis.set_major_formatter(PercentFormatter(1.0))
                ax.set_ylabel("recovered")
                if baseline is not None:
                    ax.axhline(baseline, color=INK, lw=1.3, ls=(0, (5, 3)), label="baseline")
            else:
                ax.set_ylabel(_words(panel[0]))
        axes[-1].set_xlabel(f"environment {x}" if x == "steps" else _words(x))
        axes[-1].xaxis.set_major_formatter(FuncFormatter(_thousands))
        figure.align_ylabels()
        axes[0].set_title(title)
        if rates:
            legend_below(figure, axes[0])


def trial_timeseries(
    path: str | Path,
    t: ArrayLike,
    signals: Mapping[str, ArrayLike],
    *,
    pushes: Sequence[tuple[float, float]] = (),
    title: str = "One trial",
) -> None:
    """CoM, CoP and capture point against the support, and how hard the motors work, in time.

    Args:
        path: PNG file to write.
        t: (n,) time [s].
        signals: any of "com", "cop", "capture_point": (n, 2), forward and left in the heading frame
            [m]; "support": (n, 2, 2), extent of the support polygon, [:, axis, (low, high)] in the
            same frame [m]; "torque": (n,), largest |τ| / τ_max over the motors. NaN is a gap.
        pushes: (start, duration) of each push [s], shaded.

    Raises:
        ValueError: an unknown signal.
        PoiseError: the file cannot be written.
    """
    lines = {
        "capture_point": (*_drawn(CAPTURE_POINT), (0, (5, 1.2)), 2.0),
        "com": (*_drawn(COM), "-", 2.0),
        "cop": (*_drawn(COP), "-", 1.1),
    }
    unknown = set(signals) - set(lines) - {"support", "torque"}
    if unknown:
        raise ValueError(
            f"unknown signals {sorted(unknown)}, known: {[*lines, 'support', 'torque']}"
        )
    t = np.asarray(t, dtype=float)
    data = {name: np.asarray(values, dtype=float) for name, values in signals.items()}
    with saved_figure(path, 7.6, 6.4) as figure:
        axes = figure.subplots(3, sharex=True, gridspec_kw={"height_ratios": [3, 3, 1.6]})
        for axis, (ax, name) in enumerate(zip(axes, ("forward", "left"), strict=False)):
            if "support" in data:
                low, high = data["support"][:, axis].T
                ax.fill_between(
                    t, low, high, fc="#F0F0F0", ec="#AAAAAA", lw=0.8, label="support", zorder=0.1
                )
            for key, (label, colour, style, width) in lines.items():
                if key in data:
                    ax.plot(t, data[key][:, axis], ls=style, color=colour, lw=width, label=label)
            ax.set_ylabel(f"{name} [m]")
            _limit_view(ax, axis, data)
        if "torque" in data:
            full = data["torque"] >= 0.999
            if full.any():
                axes[2].fill_between(
                    t,
                    0,
                    1,
                    where=full,
                    step="mid",
                    color=GREY,
                    alpha=0.35,
                    lw=0,
                    label="motor at its limit",
                )
            axes[2].plot(t, data["torque"], color=INK, lw=1.2)
        axes[2].set_ylim(0, 1.05)
        axes[2].yaxis.set_major_formatter(PercentFormatter(1.0))
        axes[2].set_ylabel("peak torque\nof limit")
        axes[2].set_xlabel("time [s]")
        axes[2].set_xlim(t[0], t[-1])
        for ax in axes:
            for start, duration in pushes:
                ax.axvspan(start, start + duration, color=PUSH.hexadecimal, alpha=0.35, lw=0,
                           label="push")  # fmt: skip
        figure.align_ylabels()
        axes[0].set_title(title)
        legend_below(figure)


def _drawn(quantity: Quantity) -> tuple[str, str]:
    """Name and colour."""
    return quantity.label, quantity.hexadecimal


def _series(ax: Axes, columns: Mapping[str, np.ndarray], x: str, name: str, index: int) -> None:
    """One column as a line, with its band; few points, as those of evaluations, get markers."""
    style = look(index)
    known = np.isfinite(columns[name])
    steps = columns[x][known]
    few = len(steps) <= 60
    ax.plot(
        steps,
        columns[name][known],
        color=style.colour,
        ls=style.line,
        lw=2.0 if few else 1.0,
        marker=style.marker if few else "",
        ms=4,
        label=_words(name),
    )
    if {f"{name}_low", f"{name}_high"} <= columns.keys():
        low, high = columns[f"{name}_low"][known], columns[f"{name}_high"][known]
        ax.fill_between(steps, low, high, color=style.colour, alpha=0.2, lw=0)


def _limit_view(ax: Axes, axis: int, data: Mapping[str, np.ndarray]) -> None:
    """Keep a fall, metres away, from flattening what happened over the support."""
    values = {name: series[:, axis] for name, series in data.items() if name != "torque"}
    shown = np.concatenate([np.empty(0), *(series.ravel() for series in values.values())])
    if not np.isfinite(shown).any():
        return
    bottom, top = np.nanmin(shown), np.nanmax(shown)
    if np.isfinite(values.get("support", np.nan)).any():
        bottom = max(bottom, np.nanmin(values["support"]) - FAR)
        top = min(top, np.nanmax(values["support"]) + FAR)
    margin = 0.05 * max(top - bottom, 0.01)
    ax.set_ylim(bottom - margin, top + margin)


def _words(name: str) -> str:
    return name.replace("_", " ")


def _thousands(value: float, _: object) -> str:
    if abs(value) >= 1e6:
        return f"{value / 1e6:g} M"
    return f"{value / 1e3:g} k" if abs(value) >= 1e3 else f"{value:g}"
