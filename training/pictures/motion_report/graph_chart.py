"""A motion graph as pictures: its adjacency matrix as a heat map, and its clips on a circle."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from poise.baselines.motion.graphs.components import strong_clips
from poise.baselines.motion.graphs.motion_graph import MotionGraph
from poise.training.pictures.report.svg import Svg

from .page import Picture

NAME = 17  # characters of a clip's name
CELL, LEFT, TOP = 30.0, 146.0, 118.0  # of the matrix
SIDE, RADIUS = 500.0, 138.0  # of the circle
HEIGHT = 2.0 * RADIUS + 64.0  # of its picture
FAINT = 0.3  # opacity of the dearest transition
#: first word of a reason → class, what it means
REASONS = {
    "K": ("mark-k", "K is too large"),
    "other": ("mark-feet", "other feet are planted"),
    "never": ("mark-never", "never, by the expert's weights"),
    "": ("mark-turn", "a joint turns too far, or another reason"),
}


def graph_pictures(graph: MotionGraph) -> list[Picture]:
    """The pictures of a graph."""
    matrix = ("K of the cheapest transition from each clip (row) to each (column): the deeper the "
              "colour, the smaller K. Cells without a number have no transition; their mark says "
              "why, and pointing at a cell tells more.")  # fmt: skip
    circle = ("An arrow leads to each clip that may follow, the stronger the smaller K is. Clips "
              "in a broken outline are not in the part in which every clip reaches every "
              "other.")  # fmt: skip
    wide = len(graph.names) > 9
    return [Picture("Which clip may follow which", matrix_chart(graph), matrix, wide),
            Picture("The graph", circle_chart(graph), circle)]  # fmt: skip


def best_transitions(graph: MotionGraph) -> np.ndarray:
    """(n, n) K of the cheapest transition of each pair; NaN where there is none."""
    number = {name: i for i, name in enumerate(graph.names)}
    costs, table = (np.full((len(number),) * 2, fill) for fill in (np.inf, np.nan))
    for t in graph.transitions:
        place = number[t.before], number[t.after]
        if graph.cost(t) < costs[place]:
            costs[place], table[place] = graph.cost(t), t.coefficient
    return table


def matrix_chart(graph: MotionGraph) -> Markup:
    """The adjacency matrix; cells that are refused carry the mark of their reason."""
    names, table = graph.names, best_transitions(graph)
    count, reasons = len(names), {(a, b): reason for a, b, reason in graph.refused}
    used = list(dict.fromkeys(_reason(text) for text in reasons.values()))
    height = TOP + CELL * count + 14.0 + 22.0 * len(used)
    width = max(LEFT + CELL * count + 70.0, 400.0)
    svg = Svg(width, height, f"Adjacency matrix of {count} clips, {len(graph.transitions)} "
              "transitions.")  # fmt: skip
    most = float(np.nanmax(table, initial=0.0)) if np.isfinite(table).any() else 0.0
    for i, before in enumerate(names):
        y = TOP + CELL * i
        svg.text(LEFT - 8.0, y + 0.5 * CELL + 4.0, short(before), "name end")
        turned = f"rotate(-48 {LEFT + CELL * (i + 0.5)} {TOP - 8.0})"
        svg.text(LEFT + CELL * (i + 0.5), TOP - 8.0, short(before), "name", transform=turned)
        for j, after in enumerate(names):
            x = LEFT + CELL * j
            if np.isfinite(value := table[i, j]):
                deep = f"{0.85 - 0.75 * np.sqrt(value / most) if most > 0.0 else 0.85:.2f}"
                svg.add("rect", x=x, y=y, width=CELL, height=CELL, class_="cell yes", opacity=deep)
                svg.text(x + 0.5 * CELL, y + 0.5 * CELL + 4.0, _number(value), "on small middle")
                continue
            svg.add("rect", x=x, y=y, width=CELL, height=CELL, class_="cell no")
            said = reasons.get((before, after), "none")
            _mark(svg, _reason(said), x + 0.5 * CELL, y + 0.5 * CELL, f"{before} → {after}: {said}")
    for k, reason in enumerate(used):
        y = TOP + CELL * count + 24.0 + 22.0 * k
        _mark(svg, reason, LEFT + 8.0, y - 4.0, "")
        svg.text(LEFT + 24.0, y, REASONS[reason][1], "name")
    return svg.render("plot wide" if count > 9 else "plot")


def circle_chart(graph: MotionGraph) -> Markup:
    """The clips on a circle with their names, and an arrow for every pair with a transition."""
    names, table = graph.names, best_transitions(graph)
    svg = Svg(SIDE, HEIGHT, f"Graph of {len(names)} clips.")
    centre = np.array([0.5 * SIDE, 0.5 * HEIGHT])
    angles = 2.0 * np.pi * np.arange(len(names)) / len(names) - 0.5 * np.pi
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    places = centre + RADIUS * outward
    most = float(np.nanmax(table)) if np.isfinite(table).any() else 0.0
    for (i, j), value in np.ndenumerate(table):
        if i != j and np.isfinite(value):
            strength = 1.0 - (1.0 - FAINT) * np.sqrt(value / most) if most > 0.0 else 1.0
            tip = f"{names[i]} → {names[j]}: K = {value:.3g}"
            _arrow(svg, places[i], places[j], f"{strength:.2f}", tip)
    strong = set(strong_clips(graph))
    for place, out, name in zip(places, outward, names, strict=True):
        apart = "" if name in strong else " apart"
        svg.add("circle", cx=place[0], cy=place[1], r=6.0, class_=f"node{apart}")
        x, y = place + 13.0 * out
        anchor = "middle" if abs(out[0]) < 0.3 else ("" if out[0] > 0.0 else "end")
        svg.text(x, y + 4.0 + 5.0 * out[1], short(name), f"name on {anchor}".rstrip())
    return svg.render()


def short(name: str) -> str:
    """The end of a long name."""
    return name if len(name) <= NAME else f"…{name[1 - NAME :]}"


def _reason(text: str) -> str:
    first = text.split()[0].rstrip(",") if text else ""
    return first if first in REASONS else ""


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"


def _mark(svg: Svg, reason: str, x: float, y: float, tip: str) -> None:
    """What a refused cell carries: a cross, a bar, a ring or a slash."""
    r = 5.0
    paths = {
        "K": f"M{x - r:.1f},{y:.1f}H{x + r:.1f}M{x:.1f},{y - r:.1f}V{y + r:.1f}",
        "other": f"M{x - r:.1f},{y:.1f}H{x + r:.1f}",
        "never": f"M{x - r:.1f},{y - r:.1f}L{x + r:.1f},{y + r:.1f}M{x - r:.1f},{y + r:.1f}"
                 f"L{x + r:.1f},{y - r:.1f}",
        "": f"M{x - r:.1f},{y + r:.1f}L{x + r:.1f},{y - r:.1f}",
    }  # fmt: skip
    with svg.group(class_=REASONS[reason][0]):
        if tip:
            svg.add("title", tip)
        svg.add("path", d=paths[reason])


def _arrow(svg: Svg, start: np.ndarray, end: np.ndarray, opacity: str, tip: str) -> None:
    """A bent arrow from node to node, so that both ways between two nodes are seen."""
    along = (end - start) / np.linalg.norm(end - start)
    side = np.array([-along[1], along[0]])
    first, last = start + 8.0 * along + 2.5 * side, end - 9.0 * along + 2.5 * side
    middle = 0.5 * (first + last) + 0.1 * float(np.linalg.norm(end - start)) * side
    aim = (last - middle) / np.linalg.norm(last - middle)
    square = np.array([-aim[1], aim[0]])
    corners = [last, last - 8.0 * aim + 3.4 * square, last - 8.0 * aim - 3.4 * square]
    x1, y1, xm, ym, x2, y2 = (float(v) for v in (*first, *middle, *(last - 4.0 * aim)))
    with svg.group(opacity=opacity):
        svg.add("title", tip)
        svg.add("path", d=f"M{x1:.1f},{y1:.1f}Q{xm:.1f},{ym:.1f} {x2:.1f},{y2:.1f}", class_="arrow")
        svg.add("path", d="M" + "L".join(f"{x:.1f},{y:.1f}" for x, y in corners) + "Z",
                class_="head")  # fmt: skip
