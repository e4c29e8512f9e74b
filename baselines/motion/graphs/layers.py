"""The graph in which a way that plays wanted clips in order is a shortest way.

A node is a moment of a clip in one of the layers: layer 2k has the wanted clips up to number k
behind it and plays any clip on the way; layer 2k + 1 plays wanted clip number k, which is entered
in its first quarter and left in its last one. So a way is a way of moments; of two moments of one
clip the later one is reached by playing on.
"""

import re
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from poise.configs.errors import ConfigError

from .k_best import k_best
from .moments import Moments
from .motion_graph import MotionGraph, Transition, earliest_part, latest_part
from .paths import Path, PathTask, Step

SHORT = 1e-6  # of the price of time: of two ways that cost the same the shorter one is taken
OFFSET = 1.0  # of the edges out of the start, as a sparse graph has no edges of 0


class Layers:
    """The layered graph of a task; node = layer · moments + moment, then start and end."""

    def __init__(self, graph: MotionGraph, task: PathTask):
        self.task, self.graph = task, graph
        self.moments = Moments(graph, [*task.start, *task.goal])
        self.size = len(self.moments)
        self.begin = self.size * (2 * len(task.actions) + 1)
        self.end = self.begin + 1
        self.price = graph.thresholds.time_price
        self._edges: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._link()

    def best(self, k: int) -> list[Path]:
        """The k cheapest paths, the best first; fewer if there are no more."""
        rows, columns, costs = (np.concatenate(part) for part in zip(*self._edges, strict=True))
        matrix = csr_array((costs, (rows, columns)), shape=(self.end + 1, self.end + 1))
        if k > 1 and (several := k_best(matrix, self.begin, self.end, k)):
            return [self._path(nodes, cost) for cost, nodes in several]
        self._ahead, before = dijkstra(matrix, indices=self.begin, return_predecessors=True)
        cost = float(self._ahead[self.end])
        return [self._path(_back_to(self.begin, before, self.end), cost)] if cost < np.inf else []

    def no_way(self, known: Mapping[Transition, str]) -> ConfigError:
        """The error of a task without a path: how far it goes, and what would be nearest."""
        actions, moments = self.task.actions, self.moments
        seen = np.isfinite(self._ahead[: self.begin]).reshape(-1, self.size)
        met = [bool(seen[2 * k + 1].any()) for k in range(len(actions))]
        k = met.index(False) if False in met else len(actions)
        before = repr(actions[k - 1]) if k else "the start"
        after = repr(actions[k]) if k < len(actions) else "the goal"
        numbers = {int(i) for i in moments.clip[seen[2 * k] | (seen[2 * k - 1] if k else False)]}
        reached = [moments.names[i] for i in sorted(numbers)]
        wanted = actions[k : k + 1] or tuple(name for name, _ in self.task.goal)
        reasons = [reason for a, b, reason in self.graph.refused if a in reached and b in wanted]
        reasons += [text for t, text in known.items() if text and t.after in wanted]
        said = f"; nearest to it: {min(reasons, key=_size)}" if reasons else ""
        return ConfigError(f"no way from {before} to {after} (reachable: "
                           f"{', '.join(reached[:20]) or 'nothing'}{said})")  # fmt: skip

    def _path(self, nodes: list[int], cost: float) -> Path:
        """Return the path of all nodes from begin to end: nodes between which a clip continues are
        one step."""
        groups, after = [[nodes[1]]], []
        for last, node in pairwise(nodes[1:-1]):
            transition = self._transition(last, node)
            if transition is None:
                groups[-1].append(node)
            else:
                groups.append([node])
                after.append(transition)
        ends = [(self.moments.place(g[0] % self.size), self.moments.place(g[-1] % self.size))
                for g in groups]  # fmt: skip
        steps = tuple(
            Step(name, enter, leave, bool(g[0] // self.size % 2), t)
            for ((name, enter), (_, leave)), g, t in zip(ends, groups, [*after, None], strict=True)
        )
        return Path(steps, cost - OFFSET)

    def _transition(self, last: int, node: int) -> Transition | None:
        """The transition of an edge, or None for playing on."""
        layer, pair = last // self.size, (last % self.size, node % self.size)
        if layer == node // self.size:
            number = self.moments.joined(*pair) if layer % 2 == 0 else None
            way = number is not None and self.moments.way_joins[number]
            return self.moments.transition(*pair) if way else None
        if layer % 2 and (arrow := self.task.arrows.get(layer // 2)) is not None:
            return arrow
        return self.moments.transition(*pair)

    def _link(self) -> None:
        moments, actions = self.moments, self.task.actions
        for layer in range(0, 2 * len(actions) + 1, 2):  # any clips on the way
            base = layer * self.size
            plays, joins = moments.way_plays, moments.way_joins
            self._add(base + moments.plays[plays], self.price * moments.lasts[plays])
            self._add(base + moments.joins[joins], moments.costs[joins])
        for k, name in enumerate(actions):
            self._link_action(k, name)
        self._link_ends()

    def _link_action(self, k: int, name: str) -> None:
        moments, layer = self.moments, (2 * k + 1) * self.size
        inside = moments.clip[moments.plays[:, 0]] == moments.number(name)
        self._add(layer + moments.plays[inside], SHORT * self.price * moments.lasts[inside])
        into = self._joins_of(k, 1)
        self._add_joins(into, layer - self.size, layer, self._skipped_before(k, into))
        out = self._joins_of(k, 0)
        if (arrow := self.task.arrows.get(k)) is not None:
            ends = [moments.at(arrow.before, arrow.leave), moments.at(arrow.after, 0.0)]
            self._add(np.array([[layer + ends[0], layer + 2 * self.size + ends[1]]]),
                      np.array([self.graph.cost(arrow)]))  # fmt: skip
            return
        skipped = self.price * (moments.lengths[name] - moments.time[moments.joins[out, 0]])
        self._add_joins(out, layer, layer + self.size, skipped)
        if k + 1 < len(self.task.actions):
            both = np.intersect1d(out, self._joins_of(k + 1, 1))
            cost = self.price * (moments.lengths[name] - moments.time[moments.joins[both, 0]])
            self._add_joins(both, layer, layer + 2 * self.size,
                            cost + self._skipped_before(k + 1, both))  # fmt: skip

    def _joins_of(self, k: int, end: int) -> np.ndarray:
        """The transitions into an action (`end` 1), early in it, or out of it (0), late in it."""
        moments, name = self.moments, self.task.actions[k]
        moment, length = moments.joins[:, end], moments.lengths[name]
        time = moments.time[moment]
        fits = time <= earliest_part(length) if end else time >= latest_part(length)
        return np.flatnonzero((moments.clip[moment] == moments.number(name)) & fits)

    def _skipped_before(self, k: int, joins: np.ndarray) -> np.ndarray:
        return self.price * self.moments.time[self.moments.joins[joins, 1]]

    def _link_ends(self) -> None:
        moments, actions = self.moments, self.task.actions
        lengths = moments.lengths
        last = 2 * len(actions) - 1
        start = dict(self.task.start) or {(actions[0], 0.0): 0.0}
        for (name, time), cost in start.items():
            node = moments.at(name, time)
            if actions and name == actions[0] and time <= earliest_part(lengths[name]):
                self._add_one(self.begin, self.size + node, OFFSET + cost + self.price * time)
            if self.task.start:
                self._add_one(self.begin, node, OFFSET + cost)
        goal = dict(self.task.goal) or {(actions[-1], lengths[actions[-1]]): 0.0}
        for (name, time), cost in goal.items():
            node = moments.at(name, time)
            if actions and name == actions[-1] and time >= latest_part(lengths[name]):
                self._add_one(last * self.size + node, self.end,
                              SHORT + cost + self.price * (lengths[name] - time))  # fmt: skip
            if self.task.goal:
                self._add_one((last + 1) * self.size + node, self.end, SHORT + cost)

    def _add(self, pairs: np.ndarray, costs: np.ndarray) -> None:
        self._edges.append((pairs[:, 0], pairs[:, 1], np.maximum(costs, SHORT * 1e-6)))

    def _add_one(self, start: int, end: int, cost: float) -> None:
        self._add(np.array([[start, end]]), np.array([cost]))

    def _add_joins(self, joins: np.ndarray, start: int, end: int, more: np.ndarray) -> None:
        pairs = self.moments.joins[joins] + np.array([start, end])
        self._add(pairs, self.moments.costs[joins] + more)


def _back_to(begin: int, before: np.ndarray, end: int) -> list[int]:
    """The nodes from a begin to an end, by the predecessor of each."""
    nodes = [end]
    while nodes[-1] != begin:
        nodes.append(int(before[nodes[-1]]))
    return nodes[::-1]


def _size(reason: str) -> float:
    """K in the text of a reason; those without come last."""
    found = re.match(r"K = ([0-9.e+]+) ", reason)
    return float(found.group(1)) if found else np.inf
