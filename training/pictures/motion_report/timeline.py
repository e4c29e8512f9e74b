"""A script over time: what is played when, what lies over it, and how it is led on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.scripts.printer import term_text
from poise.configs.errors import ConfigError
from poise.training.pictures.report.svg import Chart, Svg, ticks

from .page import Picture
from .trace import Trace

WIDTH, LEFT, RIGHT = 1000.0, 64.0, 990.0
TOP, ROW, LANE, GAP = 34.0, 34.0, 64.0, 30.0
LETTER = 6.1  # width of one at the size of names
NARROW = 14.0  # a box that is narrower has its name beside it no more
BOUNDS = 0.0, 1.3  # of tempo and β
#: what, begin, end, wanted, whether it is a transition, its physics
Part = tuple[str, float, float, bool, bool, Mapping[str, Any] | None]


def timeline_picture(record: Mapping[str, Any], trace: Trace | None = None) -> Picture:
    """The picture of a script's record, as `Synthesis.make` gives it; with a trace as performed.

    Raises ConfigError for a record that is none.
    """
    try:
        played = [(str(p["what"]), float(p["begins"]), float(p["ends"]), bool(p["wanted"]),
                   p["coefficient"] is not None or p.get("physics") is not None,
                   p.get("physics")) for p in record["played"]]  # fmt: skip
        duration = float(record["duration"])
    except (KeyError, TypeError, ValueError, AttributeError):
        raise ConfigError("holds no record of a script", field="played") from None
    caption = ("Columns follow each other, rows happen at once. Between the clips stand the "
               "transitions, filled, with their durations; broken outlines are clips that the "
               "script did not ask for.")  # fmt: skip
    key = {"joining": "transition"}
    if trace is not None:
        caption += (" Below: the tempo of the motion's time, and β, which is 1 where the centre "
                    "of mass is where the motion has it. Shaded is the push.")  # fmt: skip
        key |= {"tempo": "tempo", "beta": "β"}
    svg = _timeline(played, duration, trace)
    return Picture("The script", svg, caption, wide=True, key=key)


def _timeline(played: Sequence[Part], duration: float, trace: Trace | None) -> Markup:
    rows = [[] if part[4] else layers_of(part[0]) for part in played]
    count = max([1, *(len(row) for row in rows)])
    end = max(duration, 0.0 if trace is None else float(trace.motion_time[-1]), 1e-3)
    bottom = TOP + ROW * count + 18.0
    height = bottom + (GAP + LANE + 14.0 if trace is not None else 0.0) + 44.0
    svg = Svg(WIDTH, height, f"Timeline of {duration:.1f} s, {len(played)} parts.")
    chart = Chart(svg, (LEFT, TOP, RIGHT, bottom), (0.0, end), (0.0, 1.0))
    for k in range(count):
        svg.text(LEFT - 8.0, TOP + ROW * k + 20.0, "base" if k == 0 else f"over {k}", "tick end")
    for part, row in zip(played, rows, strict=True):
        what, begins, ends, wanted, _, physics = part
        left, right = (float(x) for x in chart.x(np.array([begins, ends])))
        if row:
            for k, text in enumerate(row):
                _box(svg, left, right, TOP + ROW * k, "clip" if wanted else "clip own", text)
            continue
        _join(svg, (left, right), TOP, what, ends - begins, physics)
    chart.x_axis(ticks(0.0, end, 12), "g", "" if trace is not None else "time of the motion [s]")
    if trace is not None:
        _lanes(svg, chart, bottom + GAP + 12.0, trace)
    return svg.render("plot wide")


def layers_of(what: str) -> list[str]:
    """The terms of an overlay, the base first; of anything else the name alone."""
    try:
        sequence = parse(what).sequence
    except ConfigError:  # the name of a clip with other characters
        return [what]
    if len(sequence.overlays) > 1:
        return [what]
    overlay = sequence.overlays[0]
    terms = [term_text(term) for term in overlay.terms]
    body = overlay.terms[0].body
    if len(terms) == 1 and hasattr(body, "overlays") and len(body.overlays) == 1:
        return [term_text(term) for term in body.overlays[0].terms]  # (a | b)[0:3]
    return terms


def _box(svg: Svg, left: float, right: float, y: float, class_: str, text: str) -> None:
    width = max(right - left, 1.0)
    with svg.group():
        svg.add("title", text)
        svg.add("rect", x=left, y=y, width=width, height=ROW - 6.0, rx=2.0, class_=class_)
        room = int((width - 6.0) / LETTER)
        if room >= 2:
            shown = text if len(text) <= room else f"{text[: room - 1]}…"
            svg.text(left + 4.0, y + 18.0, shown, "name small")


def _join(
    svg: Svg, span: tuple[float, float], y: float, kind: str, seconds: float,
    physics: Mapping[str, Any] | None,
) -> None:  # fmt: skip
    told = f"{kind}, {seconds:.2f} s"
    if physics:
        told += (f", ZMP {100.0 * physics['zmp_inside']:.1f} cm inside, torque "
                 f"{physics['torque']:.0%}{', bent' if physics['bent'] else ''}"
                 f"{', by standing' if physics['through_standing'] else ''}")  # fmt: skip
    with svg.group():
        svg.add("title", told)
        width = max(span[1] - span[0], 1.5)
        svg.add("rect", x=span[0], y=y - 4.0, width=width, height=ROW + 2.0,
                class_="join" if kind == "physical" else "join insert")  # fmt: skip
        svg.text(0.5 * sum(span), y - 8.0, f"{seconds:.1f}", "small middle")


def _lanes(svg: Svg, above: Chart, top: float, trace: Trace) -> None:
    chart = Chart(svg, (LEFT, top, RIGHT, top + LANE), above.x_range, BOUNDS)
    for start, length in trace.pushes:
        left, right = chart.x(np.array([start, start + length]))
        svg.add("rect", x=left, y=top, width=max(right - left, 1.5), height=LANE, class_="push")
    chart.y_axis([0.0, 0.5, 1.0])
    svg.text(LEFT, top - 7.0, "tempo and β", "axis")
    shown = trace.time <= above.x_range[1]
    x = chart.x(trace.time[shown])
    svg.path(x, chart.y(np.clip(trace.beta[shown], *BOUNDS)), "line beta")
    svg.path(x, chart.y(np.clip(trace.tempo[shown], *BOUNDS)), "line tempo")
    chart.x_axis(ticks(*above.x_range, 12), "g", "time [s]")
