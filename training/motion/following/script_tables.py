"""Printed tables of motion graphs and of plans."""

from rich.console import Console
from rich.markup import escape

from poise.baselines.motion.graphs.moments import strong_clips
from poise.baselines.motion.graphs.motion_graph import MotionGraph
from poise.baselines.motion.synthesis.synthesis import Plan
from poise.training.running.tables import text_table

MOST_ROWS = 60


def print_graph(graph: MotionGraph, console: Console) -> None:
    """The cheapest transition of each pair, why others have none, and who reaches whom."""
    refused = {(a, b): reason for a, b, reason in graph.refused}
    pairs = [(a, b) for a in graph.names for b in graph.names]
    rows = []
    for a, b in pairs[:MOST_ROWS]:
        found = graph.between(a, b)
        if found:
            t = found[0]
            rows.append((a, b, f"{t.leave:.2f} → {t.enter:.2f} s", f"{t.duration:.2f} s",
                         f"{t.coefficient:.3g}"))  # fmt: skip
        else:
            rows.append((a, b, "", "", refused.get((a, b), "none")))
    title = f"{len(graph.clips)} clips, {len(graph.transitions)} transitions"
    console.print(text_table(title, ("from", "to", "at", "in", "K"), (), rows))
    if len(pairs) > MOST_ROWS:
        console.print(f"and {len(pairs) - MOST_ROWS} pairs more")
    strong = strong_clips(graph)
    console.print(f"each reaches each other: {escape(', '.join(strong) or 'none')}")


def print_plan(plan: Plan, script: str, console: Console) -> None:
    """Every way of a plan, step by step, with its cost."""
    console.print(escape(script), soft_wrap=True)
    for number, path in enumerate(plan.paths, start=1):
        rows = []
        for step in path.steps:
            t = step.after
            then = "" if t is None else f"{t.duration:.2f} s, K = {t.coefficient:.3g}"
            name = step.clip if step.wanted else f"({step.clip})"
            rows.append((name, f"{step.enter:.2f} s", f"{step.leave:.2f} s", then))
        title = f"way {number}, cost {path.cost:.4g}"
        console.print(text_table(title, ("clip", "from", "to", "then"), (), rows))
