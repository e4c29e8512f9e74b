"""A motion's ZMP inside the soles, and the errors of its performance, over time."""

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from poise.baselines.motion.feasibility.check import Feasibility
from poise.envs.viewing.quantities import COM, COP
from poise.training.pictures.figures.page_svg import tag
from poise.training.pictures.figures.palette import SERIES
from poise.training.pictures.figures.style import Inline, area_sample, sample, saved_figure
from poise.training.pictures.figures.time_series import SOLES, shade_pushes

from .page import Picture
from .trace import Trace

CHANGE = 0.01  # [m] by which the reach of the soles changes from one sample to the next in a step
OUTSIDE = 0.06  # [m] beyond the soles that is still shown
ZMP: dict[str, Any] = {"color": COP.hexadecimal, "lw": 1.5}
MEASURED: dict[str, Any] = {"color": COM.hexadecimal, "lw": 1.1}


def zmp_picture(judged: Feasibility, trace: Trace | None = None) -> Picture:
    """The ZMP of a reference beside the hull of its soles; with a trace the measured CoP, too."""
    least, outside = 100.0 * float(judged.zmp_margin.min()), judged.zmp_margin < 0.0
    caption = "The ZMP of the motion, forward and to the left, and the reach of the soles. It is "
    if least >= 0.0:
        caption += f"at least {least:.1f} cm inside."
    else:
        caption += f"outside for {outside.mean():.1%} of the time, by {-least:.1f} cm at most."
    key = {"ZMP of the motion": sample(COP.hexadecimal, "-")}
    if trace is not None:
        caption += " Measured is the centre of pressure under the soles as they stand."
        key["measured"] = sample(COM.hexadecimal, "-")
    key["soles"] = area_sample(**SOLES)
    return Picture("ZMP inside the soles", _zmp(judged, trace), caption, key)


def errors_picture(trace: Trace) -> Picture:
    """Bodies, CoM and joints of a performance against the motion."""
    caption = (f"Distance of the bodies (mean) and of the centre of mass from where the motion has "
               f"them, and the joints' errors. Largest: bodies {1e3 * trace.bodies.max():.0f} mm, "
               f"joints {np.degrees(trace.joints.max()):.1f}°.")  # fmt: skip
    if trace.pushes:
        caption += " Shaded is the push."
    return Picture("Errors while performed", _errors(trace), caption)


def _zmp(judged: Feasibility, trace: Trace | None) -> Inline:
    middle = judged.support.mean(axis=0)
    reach, points = judged.reach - middle, judged.zmp - middle
    end = float(judged.times[-1])
    out = Inline("ZMP of the motion inside the soles.")
    with saved_figure(out, 7.2, 6.0) as figure:
        axes = figure.subplots(2, sharex=True)
        for axis, (ax, name) in enumerate(zip(axes, ("forward", "left"), strict=True)):
            low, high = (reach[:, side, axis] for side in range(2))
            ax.set(xlim=(0.0, end), ylim=(low.min() - OUTSIDE, high.max() + OUTSIDE),
                   ylabel=f"{name} [m]")  # fmt: skip
            _band(ax, judged.times, low, high)
            if trace is not None:
                shade_pushes(ax, trace.pushes, end)
                seen = trace.time <= end
                cop = np.clip(trace.cop[seen, axis], *ax.get_ylim())
                ax.plot(trace.time[seen], cop, **MEASURED)
            ax.plot(judged.times, np.clip(points[:, axis], *ax.get_ylim()), **ZMP)
        axes[-1].set_xlabel("time [s]")
        figure.align_ylabels()
    return out


def _errors(trace: Trace) -> Inline:
    panels = (
        ("bodies [mm]", 1e3 * trace.bodies),
        ("centre of mass [mm]", 1e3 * trace.com),
        ("joints [°]", np.degrees(trace.joints)),
    )
    out, end = Inline("Errors of bodies, centre of mass and joints over time."), trace.time[-1]
    with saved_figure(out, 7.2, 7.6) as figure:
        axes = figure.subplots(len(panels), sharex=True)
        for k, (ax, (title, values)) in enumerate(zip(axes, panels, strict=True)):
            shade_pushes(ax, trace.pushes, end)
            ax.plot(trace.time, values, color=SERIES[k], lw=1.6)
            ax.set(xlim=(0.0, end), ylabel=title)
            ax.set_ylim(0.0, 1.05 * max(float(np.nanmax(values)), 1e-6))
        axes[-1].set_xlabel("time [s]")
        figure.align_ylabels()
    return out


def _band(ax: Axes, times: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
    """What the planted soles reach: a box for each time between two steps."""
    changes = np.abs(np.diff(np.stack([low, high]), axis=1)).max(axis=0) > CHANGE
    edges = [0, *(np.flatnonzero(changes) + 1), len(times)]
    for a, b in pairwise(edges):
        ends = np.median(low[a:b]), np.median(high[a:b])
        ax.fill_between(times[[a, min(b, len(times) - 1)]], *ends, **SOLES, gid=tag(tip="soles"))
