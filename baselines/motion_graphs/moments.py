"""The moments of clips at which something may begin or end, and the edges between them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .motion_graph import MotionGraph, Transition
from .paths import Place


class Moments:
    """The moments of all clips of a graph, and the edges between them, as arrays.

    Attributes:
        place: (n,) clip and time of each moment, of a clip in order of time.
        plays: (p, 2) moments that follow each other in a clip; `lasts` (p,) [s].
        joins: (t, 2) moments of each of `transitions`; `costs` (t,).
        way_plays, way_joins: which of them a way uses: of two between the same moments the cheaper.
    """

    def __init__(self, graph: MotionGraph, extra: Iterable[Place] = ()):
        self.names, self.lengths = graph.names, {c.name: c.duration for c in graph.clips}
        order = {name: i for i, name in enumerate(self.names)}
        cheapest: dict[tuple[Place, Place], Transition] = {}
        for t in sorted(graph.transitions, key=graph.cost, reverse=True):
            cheapest[(t.before, t.leave), (t.after, t.enter)] = t
        places = {place for pair in cheapest for place in pair} | set(extra)
        places |= {(name, time) for name, end in self.lengths.items() for time in (0.0, end)}
        self.place: list[Place] = sorted(places, key=lambda place: (order[place[0]], place[1]))
        self.index = {place: i for i, place in enumerate(self.place)}
        self.clip = np.array([order[name] for name, _ in self.place])
        self.time = np.array([time for _, time in self.place])
        follow = np.flatnonzero(np.diff(self.clip) == 0)
        self.plays = np.stack([follow, follow + 1], axis=1)
        self.lasts = self.time[follow + 1] - self.time[follow]
        self.transitions = list(cheapest.values())
        self.joins = np.array(
            [(self.index[a], self.index[b]) for a, b in cheapest], int).reshape(-1, 2)  # fmt: skip
        self.costs = np.array([graph.cost(t) for t in self.transitions])
        self.way_plays = np.ones(len(self.plays), bool)
        self.way_joins = np.ones(len(self.joins), bool)
        self._part(graph.thresholds.time_price)
        self.joined = {(int(a), int(b)): t for (a, b), t in zip(
            self.joins, self.transitions, strict=True)}  # fmt: skip
        self.way_joined = {pair for pair, kept in zip(self.joined, self.way_joins, strict=True)
                           if kept}  # fmt: skip

    def _part(self, price: float) -> None:
        """Leave out the dearer of playing on and jumping between the same two moments."""
        play_at = {int(start): i for i, start in enumerate(self.plays[:, 0])}
        for i in np.flatnonzero(self.joins[:, 1] == self.joins[:, 0] + 1):
            play = play_at.get(int(self.joins[i, 0]))
            if play is not None:
                jump = self.costs[i] < price * self.lasts[play]
                self.way_plays[play], self.way_joins[i] = not jump, jump

    def __len__(self) -> int:
        return len(self.place)

    def number(self, name: str) -> int:
        """The number of a clip."""
        return self.names.index(name)
