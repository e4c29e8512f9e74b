"""The report's picture of one trial over time, as an SVG that follows the page's theme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from markupsafe import Markup

from .cells import Download, csv_text, download
from .svg import Chart, Svg, ticks

WIDTH, LEFT, RIGHT = 440.0, 46.0, 432.0
PANELS = (96.0, 96.0, 84.0, 60.0)  # heights: forward, left, angular momentum, torque
GAP, TOP = 30.0, 22.0
FAR = 0.25  # beyond the support, not shown [m]
LINES = {"capture_point": "capture", "com": "com", "cop": "cop"}
POINTS = {"com": ("com_x", "com_y"), "cop": ("cop_x", "cop_y"),
          "capture_point": ("capture_x", "capture_y"),
          "angular_momentum": ("L_x", "L_y", "L_z")}  # fmt: skip


def time_plot(
    t: np.ndarray,
    columns: Mapping[str, np.ndarray],
    end: float,
    pushes: Sequence[tuple[float, float]],
    label: str,
) -> Markup:
    """CoM, CoP and capture point against the support, angular momentum, and torque, over time.

    Args:
        t, columns: as `Signals` has them.
        end: last time shown [s].
        pushes: (start, duration) of each push [s], shaded.
        label: what the picture shows.
    """
    svg = Svg(WIDTH, TOP + sum(PANELS) + GAP * (len(PANELS) - 1) + 42.0, label)
    shown = t <= end + 1e-9
    t, data = t[shown], {name: values[shown] for name, values in columns.items()}
    top = TOP
    titles = ("forward [m]", "left [m]", "angular momentum L [kg·m²/s]", "largest torque")
    for panel, (height, title) in enumerate(zip(PANELS, titles, strict=True)):
        box = (LEFT, top, RIGHT, top + height)
        span = _span(panel, data)
        chart = Chart(svg, box, (0.0, end), span)
        for start, duration in pushes:
            left, right = chart.x(np.minimum([start, start + duration], end))
            svg.add("rect", x=left, y=top, width=right - left, height=height, class_="push")
        marks = [0.0, 0.5, 1.0] if panel == 3 else ticks(*span, 5 if panel < 2 else 3)
        chart.y_axis(marks, ".0%" if panel == 3 else "g")
        svg.text(LEFT, top - 7, title, "axis")
        if panel == len(PANELS) - 1:
            chart.x_axis(ticks(0.0, end, 6), "g", "time [s]")
        _draw(chart, panel, t, data)
        top += height + GAP
    return svg.render("plot time")


def signals_csv(name: str, t: np.ndarray, columns: Mapping[str, np.ndarray]) -> Download:
    """All signals as CSV, to a hundredth of what the plot shows."""
    header, blocks = ["t"], [t[:, None]]
    for key, titles in POINTS.items():
        header += titles
        blocks.append(columns[key])
    header += ["support_x_low", "support_x_high", "support_y_low", "support_y_high", "torque"]
    blocks += [columns["support"].reshape(len(t), 4), columns["torque"][:, None]]
    lines = [[f"{value:.5g}" for value in line] for line in np.hstack(blocks)]
    return download(f"{name}.csv", csv_text(header, lines))


def _draw(chart: Chart, panel: int, t: np.ndarray, data: Mapping[str, np.ndarray]) -> None:
    """The lines of a panel, without what lies outside it."""
    svg, x = chart.svg, chart.x(t)

    def y(values: np.ndarray) -> np.ndarray:
        inside = (chart.y_range[0] <= values) & (values <= chart.y_range[1])
        return np.where(inside, chart.y(values), np.nan)

    if panel < 2:
        low, high = chart.y(np.clip(data["support"][:, panel], *chart.y_range)).T
        svg.path(np.r_[x, x[::-1]], np.r_[low, high[::-1]], "support", close=True)
        for key, class_ in LINES.items():
            svg.path(x, y(data[key][:, panel]), f"line {class_}")
    elif panel == 2:
        for axis, class_ in enumerate(("l-forward", "l-left", "l-up")):
            svg.path(x, y(data["angular_momentum"][:, axis]), f"line {class_}")
    else:
        svg.path(x, y(data["torque"]), "line torque")


def _span(panel: int, data: Mapping[str, np.ndarray]) -> tuple[float, float]:
    """Range of a panel; a fall, metres away, must not flatten what happened over the support."""
    if panel == 3:
        return 0.0, 1.05
    if panel == 2:
        values = data["angular_momentum"]
        reach = float(np.nanmax(np.abs(values), initial=0.1))
        return -1.05 * reach, 1.05 * reach
    support = data["support"][:, panel]
    points = np.concatenate([data[key][:, panel] for key in LINES])
    points = points[np.isfinite(points)]
    # The support of the standing posture: after a fall it is of hands and knees too.
    low, high = support[0].min(), support[0].max()
    return (
        float(min(low, max(points.min(initial=low), low - FAR)) - 0.01),
        float(max(high, min(points.max(initial=high), high + FAR)) + 0.01),
    )
