"""Pictures of a motion graph: its adjacency matrix as a heat map, and the graph as a circle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch, Rectangle

from poise.baselines.motion.graphs.motion_graph import MotionGraph

from .palette import BLUE, GREY, INK, PALE
from .style import saved_figure

LABEL = 17  # characters of a clip's name
REASONS = {"K": "////", "other": "....", "never": "xxxx"}  # by their first word; else a turn
MEANING = {"////": "K too large", "....": "other feet planted", "xxxx": "never, by the expert",
           "\\\\\\\\": "a joint turns too far"}  # fmt: skip


def plot_graph(path: str | Path, graph: MotionGraph) -> None:
    """K of the cheapest transition from each clip (row) to each (column), and who follows whom.

    Pairs without a transition are grey, hatched by the reason. On the circle an arrow is the
    darker, the smaller K is.

    Raises PoiseError if the file cannot be written.
    """
    size = 2.4 + 0.42 * len(graph.names)
    with saved_figure(path, 2.2 * size + 1.0, size + 0.9) as figure:
        left, right = figure.subplots(1, 2)
        table = best_coefficients(graph)
        image = left.imshow(table, cmap="viridis_r", vmin=0.0)
        figure.colorbar(image, ax=left, label="K of the cheapest transition", shrink=0.8)
        _hatch(left, graph, table)
        _name_axes(left, graph)
        _circle(right, graph, table)


def best_coefficients(graph: MotionGraph) -> np.ndarray:
    """(n, n) K of the cheapest transition of each pair; NaN where there is none."""
    table = np.full((len(graph.names),) * 2, np.nan)
    for i, before in enumerate(graph.names):
        for j, after in enumerate(graph.names):
            if found := graph.between(before, after):
                table[i, j] = found[0].coefficient
    return table


def _hatch(axes: Axes, graph: MotionGraph, table: np.ndarray) -> None:
    used = set()
    for before, after, reason in graph.refused:
        i, j = graph.names.index(before), graph.names.index(after)
        hatch = REASONS.get(reason.split()[0].rstrip(","), "\\\\\\\\")
        label = "" if hatch in used else MEANING[hatch]
        used.add(hatch)
        axes.add_patch(Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, facecolor=PALE, edgecolor=GREY,
                                 hatch=hatch, linewidth=0.0, label=label))  # fmt: skip
    for (i, j), value in np.ndenumerate(table):
        if np.isfinite(value):
            dark = value > 0.5 * np.nanmax(table)
            axes.text(j, i, f"{value:.2g}", ha="center", va="center", fontsize=8,
                      color="white" if dark else INK)  # fmt: skip
    if used:
        axes.figure.legend(loc="outside lower left", ncols=2)


def _name_axes(axes: Axes, graph: MotionGraph) -> None:
    names = [_short(name) for name in graph.names]
    axes.set_xticks(range(len(names)), names, rotation=60, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.grid(False)
    axes.set_title("From (row) to (column)")


def _circle(axes: Axes, graph: MotionGraph, table: np.ndarray) -> None:
    angles = 0.5 * np.pi - 2.0 * np.pi * np.arange(len(graph.names)) / len(graph.names)
    places = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    most = np.nanmax(table) if np.isfinite(table).any() else 1.0
    for (i, j), value in np.ndenumerate(table):
        if i != j and np.isfinite(value):
            axes.add_patch(FancyArrowPatch(
                tuple(places[i]), tuple(places[j]), connectionstyle="arc3,rad=0.12", shrinkA=6,
                shrinkB=6, arrowstyle="-|>", mutation_scale=9, color=BLUE,
                alpha=float(1.0 - 0.85 * value / most) if most > 0.0 else 1.0))  # fmt: skip
    axes.plot(*places.T, "o", color=INK, markersize=6, markerfacecolor="white")
    for place, name in zip(places, graph.names, strict=True):
        beside = abs(place[0]) > 0.3
        axes.text(
            1.09 * place[0],
            1.09 * place[1],
            _short(name),
            ha=("left" if place[0] > 0.0 else "right") if beside else "center",
            va="center" if beside else ("bottom" if place[1] > 0.0 else "top"),
            fontsize=9,
            color=INK,
        )
    axes.set(xlim=(-1.9, 1.9), ylim=(-1.25, 1.25), aspect="equal")
    axes.axis("off")
    axes.set_title("Who may follow whom")


def _short(name: str) -> str:
    return name if len(name) <= LABEL else f"…{name[1 - LABEL :]}"
