"""Random motion graphs for tests, and the search for paths without any library."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.motion.graphs.layers import SHORT
from poise.baselines.motion.graphs.motion_graph import (
    GraphClip,
    MotionGraph,
    Thresholds,
    Transition,
    Weight,
    earliest_part,
    latest_part,
)
from poise.baselines.motion.graphs.paths import PathTask
from poise.baselines.motion.graphs.search import best_paths
from poise.configs.errors import ConfigError

Node = tuple[int, str, float]  # layer, clip, time


def random_graph(rng: np.random.Generator, clips: int, each: int, share: float) -> MotionGraph:
    """Clips of 1 to 5 s; a share of the pairs has up to `each` transitions."""
    lengths = rng.uniform(1.0, 5.0, clips)
    entries = [GraphClip(f"c{i}", f"c{i}.bvh", float(length)) for i, length in enumerate(lengths)]
    transitions = [
        Transition(a.name, b.name, float(rng.uniform(0.5, 1.0) * a.duration),
                   float(rng.uniform(0.0, 0.5) * b.duration), float(rng.uniform(0.2, 2.0)),
                   float(rng.uniform(0.0, 20.0)))
        for a in entries for b in entries if rng.random() < share
        for _ in range(int(rng.integers(1, each + 1)))
    ]  # fmt: skip
    weights = tuple(Weight(a.name, b.name, float(rng.uniform(0.5, 2.0)))
                    for a in entries for b in entries if rng.random() < 0.1)  # fmt: skip
    limits = Thresholds(time_price=float(rng.uniform(0.5, 5.0)))
    return MotionGraph("", limits, tuple(entries), {}, weights, tuple(transitions))


def random_task(rng: np.random.Generator, graph: MotionGraph, actions: int) -> PathTask:
    """Wanted clips; sometimes an arrow by hand, and places to begin and end at."""
    names = tuple(str(name) for name in rng.choice(graph.names, actions))
    lengths = {clip.name: clip.duration for clip in graph.clips}
    arrows, start, goal = {}, {}, {}
    if actions > 1 and rng.random() < 0.3:
        arrows[0] = Transition(names[0], names[1], lengths[names[0]], 0.0, 0.4, 3.0)
    for places in (start, goal):
        if rng.random() < 0.3:
            for name in rng.choice(graph.names, 2, replace=False):
                places[str(name), float(rng.uniform(0.0, lengths[name]))] = float(rng.random())
    return PathTask(names, arrows, start, goal)


def brute_force(graph: MotionGraph, task: PathTask, k: int) -> list[float]:
    """Costs of the k cheapest paths that meet no moment twice: every path is walked.

    A path is not followed further where what it costs, with the least that is left to pay, is more
    than the k-th best so far.
    """
    price = graph.thresholds.time_price
    lengths = {clip.name: clip.duration for clip in graph.clips}
    times: dict[str, set[float]] = {name: {0.0, end} for name, end in lengths.items()}
    for t in graph.transitions:
        times[t.before].add(t.leave)
        times[t.after].add(t.enter)
    for name, time in (*task.start, *task.goal):
        times[name].add(time)
    ordered = {name: sorted(moments) for name, moments in times.items()}
    last, found = 2 * len(task.actions) - 1, []
    goal = task.goal or {(task.actions[-1], lengths[task.actions[-1]]): 0.0}

    def ending(node: Node) -> float | None:
        layer, name, time = node
        if (name, time) not in goal:
            return None
        if layer == last and time >= latest_part(lengths[name]):
            return SHORT + goal[name, time] + price * (lengths[name] - time)
        return SHORT + goal[name, time] if layer == last + 1 and task.goal else None

    def following(node: Node) -> list[tuple[Node, float]]:
        layer, name, time = node
        wanted, moments = layer % 2 == 1, ordered[name]
        place = moments.index(time)
        ways: dict[Node, float] = {}

        def offer(to: Node, cost: float) -> None:
            ways[to] = min(cost, ways.get(to, np.inf))

        if place + 1 < len(moments):
            gone = moments[place + 1] - time
            offer((layer, name, moments[place + 1]), price * gone * (SHORT if wanted else 1.0))
        late = not wanted or time >= latest_part(lengths[name])
        number = (layer + 1) // 2  # of the action that comes next
        if wanted and layer // 2 in task.arrows:
            arrow = task.arrows[layer // 2]
            if time == arrow.leave:
                offer((layer + 2, arrow.after, 0.0), graph.cost(arrow))
            return list(ways.items())
        for t in graph.transitions if late else ():
            if (t.before, t.leave) != (name, time):
                continue
            cost = graph.cost(t) + (price * (lengths[name] - time) if wanted else 0.0)
            offer((layer + wanted, t.after, t.enter), cost)
            fits = number < len(task.actions) and task.actions[number] == t.after
            if fits and t.enter <= earliest_part(lengths[t.after]):
                offer((2 * number + 1, t.after, t.enter), cost + price * t.enter)
        return list(ways.items())

    first, starts = task.actions[0], dict[Node, float]()
    for (name, time), cost in (task.start or {(first, 0.0): 0.0}).items():
        if name == first and time <= earliest_part(lengths[name]):
            starts[1, name, time] = cost + price * time
        if task.start:
            starts[0, name, time] = cost
    ways: dict[Node, list[tuple[Node, float]]] = {}
    ahead = list(starts)
    while ahead:
        if (node := ahead.pop()) not in ways:
            ways[node] = sorted(following(node), key=lambda way: way[1])
            ahead += [to for to, _ in ways[node]]
    left = {node: end for node in ways if (end := ending(node)) is not None}
    changed = True
    while changed:  # the cost that is left from a node on, by relaxing every way again and again
        changed = False
        for node, steps in ways.items():
            least = min((cost + left[to] for to, cost in steps if to in left), default=np.inf)
            if least < left.get(node, np.inf):
                left[node], changed = least, True

    def walk(node: Node, cost: float, met: set[Node]) -> None:
        if len(found) >= k and cost + left[node] > sorted(found)[k - 1] + 1e-9:
            return
        if (end := ending(node)) is not None:
            found.append(cost + end)
        steps = [(more + left[to], to, more) for to, more in ways[node] if to in left]
        for _, to, more in sorted(steps):
            if to not in met:
                walk(to, cost + more, met | {to})

    for node, cost in starts.items():
        if node in left:
            walk(node, cost, {node})
    return sorted(found)[:k]


def check_search(seed: int) -> int:
    """Assert that the three best paths of a random task cost what brute force says; their number.

    Graphs have up to 8 clips, tasks up to 4 wanted clips.
    """
    rng = np.random.default_rng(seed)
    graph = random_graph(rng, int(rng.integers(2, 9)), 2, float(rng.uniform(0.2, 0.8)))
    task = random_task(rng, graph, int(rng.integers(1, 5)))
    wanted = brute_force(graph, task, 3)
    try:
        paths = best_paths(graph, task, 3)
    except ConfigError:
        paths = []
    assert [path.cost for path in paths] == pytest.approx(wanted, rel=1e-9, abs=1e-9), seed
    for path in paths:
        wanted_steps = [step.clip for step in path.steps if step.wanted]
        assert wanted_steps == list(task.actions), seed
    return len(paths)
