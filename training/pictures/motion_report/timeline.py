"""Timeline of a script: clips, layers over them, and transitions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.scripts.printer import term_text
from poise.configs.errors import ConfigError
from poise.training.pictures.figures.page_svg import POINTS, tag
from poise.training.pictures.figures.palette import AMBER, GREEN, GREY, ORANGE, PALE, PURPLE
from poise.training.pictures.figures.style import Inline, area_sample, sample, saved_figure
from poise.training.pictures.figures.time_series import shade_pushes

from .page import Picture
from .trace import Trace

WIDTH, ROW = 13.9, 0.47  # of the picture, and height of one layer [in]
LETTER = 6.1  # width of one at the size of names
ROOM = 0.92 * WIDTH * POINTS  # width of the axes, nearly
BOUNDS = 0.0, 1.3  # of tempo and β
TEMPO = (ORANGE, (0, (5, 2)))
#: what, begin, end, wanted, whether it is a transition, its physics
Part = tuple[str, float, float, bool, bool, Mapping[str, Any] | None]


def timeline_picture(record: Mapping[str, Any], trace: Trace | None = None) -> Picture:
    """The picture of a script's record, as `Synthesis.make` gives it; with a trace as performed.

    Raises ConfigError for a record that is none.
    """
    try:
        parts = [(str(p["what"]), float(p["begins"]), float(p["ends"]), bool(p["wanted"]),
                  p["coefficient"] is not None or p.get("physics") is not None,
                  p.get("physics")) for p in record["parts"]]  # fmt: skip
        duration = float(record["duration"])
    except (KeyError, TypeError, ValueError, AttributeError):
        raise ConfigError("holds no record of a script", field="parts") from None
    caption = ("Columns follow each other, rows happen at once. Between the clips stand the "
               "transitions, filled, with their durations; broken outlines are clips that the "
               "script did not ask for.")  # fmt: skip
    key = {"transition": area_sample(color=AMBER)}
    if trace is not None:
        caption += (" Below: the tempo of the motion's time, and β, which is 1 where the centre "
                    "of mass is where the motion has it. Shaded is the push.")  # fmt: skip
        key |= {"tempo": sample(*TEMPO), "β": sample(GREEN, "-")}
    svg = _timeline(parts, duration, trace)
    return Picture("The script", svg, caption, key)


def _timeline(parts: Sequence[Part], duration: float, trace: Trace | None) -> Inline:
    rows = [[] if part[4] else layers_of(part[0]) for part in parts]
    count = max([1, *(len(row) for row in rows)])
    end = max(duration, 0.0 if trace is None else float(trace.motion_time[-1]), 1e-3)
    heights = [ROW * count + 0.3, *([0.9] if trace is not None else [])]
    out = Inline(f"Timeline of {duration:.1f} s, {len(parts)} parts.", WIDTH, "plot wide")
    with saved_figure(out, WIDTH, sum(heights) + 0.7) as figure:
        axes = figure.subplots(len(heights), sharex=True, squeeze=False,
                               gridspec_kw={"height_ratios": heights})[:, 0]  # fmt: skip
        script = axes[0]
        script.set(xlim=(0.0, end), ylim=(count - 0.05, -0.4))
        script.set_yticks([k + 0.4 for k in range(count)],
                          ["base", *(f"over {k}" for k in range(1, count))])  # fmt: skip
        script.grid(False)
        for part, row in zip(parts, rows, strict=True):
            for k, text in enumerate(row):
                _box(script, part, k, text, end)
            if not row:
                _join(script, part)
        if trace is not None:
            shown = trace.time <= end
            shade_pushes(axes[1], trace.pushes, end)
            beta, tempo = (np.clip(v[shown], *BOUNDS) for v in (trace.beta, trace.tempo))
            axes[1].plot(trace.time[shown], beta, color=GREEN)
            axes[1].plot(trace.time[shown], tempo, color=TEMPO[0], ls=TEMPO[1])
            axes[1].set(ylim=BOUNDS, ylabel="tempo, β", yticks=[0.0, 0.5, 1.0])
        axes[-1].set_xlabel("time [s]" if trace is not None else "time of the motion [s]")
    return out


def layers_of(what: str) -> list[str]:
    """Return the terms of an overlay, the base first; of anything else the name alone."""
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


def _box(ax: Axes, part: Part, row: int, text: str, end: float) -> None:
    """A clip with as much of its name as there is room for."""
    _, begins, ends, wanted, _, _ = part
    ax.add_patch(Rectangle((begins, row), ends - begins, 0.8, facecolor=PALE, edgecolor=GREY,
                           ls="-" if wanted else (0, (4, 2)), gid=tag(tip=text)))  # fmt: skip
    room = int(((ends - begins) / end * ROOM - 6.0) / LETTER)
    if room >= 2:
        shown = text if len(text) <= room else f"{text[: room - 1]}…"
        ax.annotate(shown, (begins, row + 0.4), (4, 0), textcoords="offset points", va="center",
                    size=10, zorder=3)  # fmt: skip


def _join(ax: Axes, part: Part) -> None:
    """A transition, filled, with its duration above it."""
    kind, begins, ends, _, _, physics = part
    tip = f"{kind}, {ends - begins:.2f} s"
    if physics:
        tip += (f", ZMP {100.0 * physics['zmp_inside']:.1f} cm inside, torque "
                 f"{physics['torque']:.0%}{', bent' if physics['bent'] else ''}"
                 f"{', by standing' if physics['through_standing'] else ''}")  # fmt: skip
    colour = AMBER if kind == "physical" else PURPLE
    ax.add_patch(Rectangle((begins, -0.08), ends - begins, 0.96, facecolor=colour, edgecolor=colour,
                           lw=1.0, gid=tag(tip=tip)))  # fmt: skip
    middle = 0.5 * (begins + ends)
    ax.text(middle, -0.14, f"{ends - begins:.1f}", ha="center", va="bottom", size=9)
