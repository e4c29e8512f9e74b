"""Pictures of a motion graph: its adjacency matrix as a heat map, and the graph as a circle."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from poise.baselines.motion.graphs.moments import strong_clips
from poise.baselines.motion.graphs.motion_graph import MotionGraph

from .page_svg import tag
from .palette import BLUE, GREY, INK, PALE
from .style import Out, legend_below, saved_figure

LABEL = 17  # characters of a clip's name
FAINT = 0.3  # opacity of the dearest transition
#: first word of a reason → the mark of a cell, what it means
REASONS: dict[str, tuple[Any, str]] = {
    "K": ("+", "K is too large"),
    "other": ("_", "other feet are planted"),
    "never": ("x", "never, by the expert's weights"),
    "": ((2, 2, -45), "a joint turns too far, or another reason"),
}
Part = Literal["matrix", "circle"]


def plot_graph(out: Out, graph: MotionGraph, parts: Sequence[Part] = ("matrix", "circle")) -> None:
    """K of the cheapest transition from each clip (row) to each (column), and who follows whom.

    The deeper the colour of a cell, or the stronger an arrow, the smaller K is. Pairs without a
    transition have the mark of the reason. A clip with a broken outline is not in the part in which
    every clip reaches every other.

    Raises PoiseError if the file cannot be written.
    """
    size = picture_size(graph)
    height = 0.7 * size if parts == ("circle",) else size
    with saved_figure(out, size * len(parts), height) as figure:
        axes = figure.subplots(1, len(parts), squeeze=False)[0]
        table = best_coefficients(graph)
        for ax, part in zip(axes, parts, strict=True):
            (_matrix if part == "matrix" else _circle)(ax, graph, table)
        legend_below(figure, columns=2)


def picture_size(graph: MotionGraph) -> float:
    """Width of the picture of a part, which grows with the number of clips [in]."""
    return max(5.4, 2.6 + 0.42 * len(graph.names))


def best_coefficients(graph: MotionGraph) -> np.ndarray:
    """Return (n, n) K of the cheapest transition of each pair; NaN where there is none."""
    table = np.full((len(graph.names),) * 2, np.nan)
    for i, before in enumerate(graph.names):
        for j, after in enumerate(graph.names):
            if found := graph.between(before, after):
                table[i, j] = found[0].coefficient
    return table


def reason_of(text: str) -> str:
    """Return the key of `REASONS` of a pair that is refused."""
    first = text.split()[0].rstrip(",") if text else ""
    return first if first in REASONS else ""


def _matrix(ax: Axes, graph: MotionGraph, table: np.ndarray) -> None:
    names, said = graph.names, {(a, b): reason for a, b, reason in graph.refused}
    for (i, j), value in np.ndenumerate(table):
        known = np.isfinite(value)
        ax.add_patch(Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, facecolor=BLUE if known else PALE,
                               alpha=_strength(value, table, 0.1, 0.6) if known else 0.5,
                               edgecolor="white", linewidth=1.0))  # fmt: skip
        if known:
            shown = f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
            ax.text(j, i, shown, ha="center", va="center", fontsize=9)
            continue
        reason = said.get((names[i], names[j]), "none")
        mark, meaning = REASONS[reason_of(reason)]
        ax.plot(j, i, ls="", marker=mark, color=GREY, ms=8, label=meaning,
                gid=tag(tip=f"{names[i]} → {names[j]}: {reason}"))  # fmt: skip
    shorter = [short(name) for name in names]
    ax.set_xticks(range(len(names)), shorter, rotation=60, ha="left", rotation_mode="anchor")
    ax.set_yticks(range(len(names)), shorter)
    ax.xaxis.tick_top()
    ax.grid(False)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    ax.set(xlim=(-0.5, len(names) - 0.5), ylim=(len(names) - 0.5, -0.5), aspect="equal")


def _circle(ax: Axes, graph: MotionGraph, table: np.ndarray) -> None:
    names, strong = graph.names, set(strong_clips(graph))
    angles = 0.5 * np.pi - 2.0 * np.pi * np.arange(len(names)) / len(names)
    places = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for (i, j), value in np.ndenumerate(table):
        if i != j and np.isfinite(value):
            ax.add_patch(FancyArrowPatch(
                tuple(places[i]), tuple(places[j]), connectionstyle="arc3,rad=0.12", shrinkA=6,
                shrinkB=6, arrowstyle="-|>", mutation_scale=9, color=BLUE,
                alpha=_strength(value, table, FAINT, 1.0),
                gid=tag(tip=f"{names[i]} → {names[j]}: K = {value:.3g}")))  # fmt: skip
    for place, name in zip(places, names, strict=True):
        ax.add_patch(Circle(tuple(place), 0.05, fc="white", ec=INK, zorder=3,
                            ls="-" if name in strong else (0, (3, 2))))  # fmt: skip
        beside = abs(place[0]) > 0.3
        ax.text(
            1.09 * place[0],
            1.09 * place[1],
            short(name),
            ha=("left" if place[0] > 0.0 else "right") if beside else "center",
            va="center" if beside else ("bottom" if place[1] > 0.0 else "top"),
            fontsize=9,
        )
    ax.set(xlim=(-1.9, 1.9), ylim=(-1.25, 1.25), aspect="equal")
    ax.axis("off")


def _strength(value: float, table: np.ndarray, least: float, most: float) -> float:
    """Opacity of a transition: the smaller K, the more."""
    largest = float(np.nanmax(table))
    return most - (most - least) * float(np.sqrt(value / largest)) if largest > 0.0 else most


def short(name: str) -> str:
    """Return the end of a long name."""
    return name if len(name) <= LABEL else f"…{name[1 - LABEL :]}"
