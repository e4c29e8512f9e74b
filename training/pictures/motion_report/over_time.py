"""A motion's ZMP inside the soles, and the errors of its performance, over time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from markupsafe import Markup

from poise.baselines.motion.feasibility.check import Feasibility
from poise.training.pictures.report.svg import Chart, Svg, ticks

from .page import Picture
from .trace import Trace

WIDTH, LEFT, RIGHT, TOP = 440.0, 46.0, 432.0, 24.0
PANEL, GAP = 110.0, 48.0
CHANGE = 0.01  # [m] by which the reach of the soles changes from one sample to the next in a step
OUTSIDE = 0.06  # [m] beyond the soles that is still shown


def zmp_picture(judged: Feasibility, trace: Trace | None = None) -> Picture:
    """The ZMP of a reference beside the hull of its soles; with a trace the measured CoP, too."""
    least, outside = 100.0 * float(judged.zmp_margin.min()), judged.zmp_margin < 0.0
    caption = "The ZMP of the motion, forward and to the left, and the reach of the soles. It is "
    if least >= 0.0:
        caption += f"at least {least:.1f} cm inside."
    else:
        caption += f"outside for {outside.mean():.1%} of the time, by {-least:.1f} cm at most."
    key = {"zmp": "ZMP of the motion", "support": "soles"}
    if trace is not None:
        caption += " Measured is the centre of pressure under the soles as they stand."
        key = {"zmp": key["zmp"], "measured": "measured", "support": "soles"}
    return Picture("ZMP inside the soles", _zmp(judged, trace), caption, key=key)


def errors_picture(trace: Trace) -> Picture:
    """Bodies, CoM and joints of a performance against the motion."""
    caption = (f"Distance of the bodies (mean) and of the centre of mass from where the motion has "
               f"them, and the joints' errors. Largest: bodies {1e3 * trace.bodies.max():.0f} mm, "
               f"joints {np.degrees(trace.joints.max()):.1f}°.")  # fmt: skip
    if trace.pushes:
        caption += " Shaded is the push."
    return Picture("Errors while performed", _errors(trace), caption)


def _zmp(judged: Feasibility, trace: Trace | None) -> Markup:
    middle = judged.support.mean(axis=0)
    reach, points = judged.reach - middle, judged.zmp - middle
    end = float(judged.times[-1])
    svg = Svg(WIDTH, TOP + 2.0 * PANEL + GAP + 42.0, "ZMP of the motion inside the soles.")
    for axis, title in enumerate(("forward [m]", "left [m]")):
        top = TOP + axis * (PANEL + GAP)
        low, high = (reach[:, side, axis] for side in range(2))
        chart = Chart(svg, (LEFT, top, RIGHT, top + PANEL), (0.0, end),
                      (low.min() - OUTSIDE, high.max() + OUTSIDE))  # fmt: skip
        _band(chart, judged.times, low, high)
        chart.y_axis(ticks(*chart.y_range, 5))
        svg.text(LEFT, top - 8.0, title, "axis")
        if trace is not None:
            _pushes(chart, trace)
            seen = trace.time <= end
            svg.path(chart.x(trace.time[seen]), _inside(chart, trace.cop[seen, axis]),
                     "line measured")  # fmt: skip
        svg.path(chart.x(judged.times), _inside(chart, points[:, axis]), "line zmp")
        chart.x_axis(ticks(0.0, end, 6), "g", "time [s]" if axis else "")
    return svg.render()


def _errors(trace: Trace) -> Markup:
    panels = (
        ("bodies [mm]", 1e3 * trace.bodies, "bodies"),
        ("centre of mass [mm]", 1e3 * trace.com, "centre"),
        ("joints [°]", np.degrees(trace.joints), "joints"),
    )
    height = TOP + len(panels) * PANEL + (len(panels) - 1) * GAP + 42.0
    svg = Svg(WIDTH, height, "Errors of bodies, centre of mass and joints over time.")
    end = float(trace.time[-1])
    for k, (title, values, class_) in enumerate(panels):
        top = TOP + k * (PANEL + GAP)
        most = 1.05 * max(float(np.nanmax(values)), 1e-6)
        chart = Chart(svg, (LEFT, top, RIGHT, top + PANEL), (0.0, end), (0.0, most))
        _pushes(chart, trace)
        chart.y_axis(ticks(0.0, most, 4))
        svg.text(LEFT, top - 8.0, title, "axis")
        svg.path(chart.x(trace.time), chart.y(values), f"line {class_}")
        chart.x_axis(ticks(0.0, end, 6), "g", "time [s]" if k == len(panels) - 1 else "")
    return svg.render()


def _pushes(chart: Chart, trace: Trace) -> None:
    top, bottom = chart.box[1], chart.box[3]
    for start, length in trace.pushes:
        left, right = chart.x(np.minimum([start, start + length], chart.x_range[1]))
        chart.svg.add("rect", x=left, y=top, width=max(right - left, 1.5), height=bottom - top,
                      class_="push")  # fmt: skip


def _band(chart: Chart, times: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
    """What the planted soles reach: a box for each time between two steps."""
    changes = np.abs(np.diff(np.stack([low, high]), axis=1)).max(axis=0) > CHANGE
    edges = [0, *(np.flatnonzero(changes) + 1), len(times)]
    for a, b in pairwise(edges):
        left, right = chart.x(np.array([times[a], times[min(b, len(times) - 1)]]))
        top, bottom = chart.y(np.array([np.median(high[a:b]), np.median(low[a:b])]))
        chart.svg.add("rect", x=left, y=top, width=right - left, height=bottom - top,
                      class_="support")  # fmt: skip


def _inside(chart: Chart, values: np.ndarray) -> np.ndarray:
    """Ordinates; what lies beyond the panel stops at its edge."""
    return chart.y(np.clip(values, *chart.y_range))
