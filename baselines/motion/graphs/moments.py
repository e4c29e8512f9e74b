"""The moments of clips at which something may begin or end, and the edges between them."""

from collections.abc import Iterable

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from .motion_graph import MotionGraph, Transition
from .paths import Place


class Moments:
    """The moments of all clips of a graph, and the edges between them, as arrays.

    Attributes:
        clip, time: (n,) number of the clip and time in it [s] of each moment, in this order.
        plays: (p, 2) moments that follow each other in a clip; `lasts` (p,) [s].
        joins: (t, 2) moments of each of `transitions`, in order; `costs` (t,). Of several between
            two moments the cheapest is kept.
        way_plays, way_joins: which of them a way uses: of two between the same moments the cheaper.
    """

    def __init__(self, graph: MotionGraph, extra: Iterable[Place] = ()):
        self.names, self.lengths = graph.names, {c.name: c.duration for c in graph.clips}
        self._order = {name: i for i, name in enumerate(self.names)}
        index = self._gather(graph, list(extra))
        self._first = np.searchsorted(self.clip, np.arange(len(self.names) + 1))
        follow = np.flatnonzero(np.diff(self.clip) == 0)
        self.plays = np.stack([follow, follow + 1], axis=1)
        self.lasts = self.time[follow + 1] - self.time[follow]
        self._link(graph, index)
        self.way_plays = np.ones(len(self.plays), bool)
        self.way_joins = np.ones(len(self.joins), bool)
        self._part(graph.thresholds.time_price)

    def _gather(self, graph: MotionGraph, extra: list[Place]) -> np.ndarray:
        """Find all moments; (2 t,) which ones transitions leave, and then enter."""
        edges, order = graph.transitions, self._order
        clips = [order[t.before] for t in edges] + [order[t.after] for t in edges]
        times = [t.leave for t in edges] + [t.enter for t in edges]
        for i, length in enumerate(self.lengths.values()):
            clips += [i, i]
            times += [0.0, length]
        clip = np.array(clips + [order[name] for name, _ in extra])
        time = np.array(times + [time for _, time in extra])
        ranked = np.lexsort((time, clip))
        clip, time = clip[ranked], time[ranked]
        new = np.append(True, (np.diff(clip) != 0) | (np.diff(time) != 0.0))
        self.clip, self.time = clip[new], time[new]
        index = np.empty(len(ranked), int)
        index[ranked] = np.cumsum(new) - 1
        return index[: 2 * len(edges)]

    def _link(self, graph: MotionGraph, index: np.ndarray) -> None:
        """Keep the cheapest transition between each two moments; of equal ones the last."""
        count, costs = len(graph.transitions), graph.costs
        leave, enter = index[:count], index[count:]
        ranked = np.lexsort((-np.arange(count), costs, enter, leave))
        keys = (leave * len(self) + enter)[ranked]
        kept = ranked[np.append(True, np.diff(keys) != 0)] if count else ranked
        self.joins = np.stack([leave[kept], enter[kept]], axis=1)
        self.costs = costs[kept]
        self.transitions = [graph.transitions[i] for i in kept]
        self._keys = leave[kept] * len(self) + enter[kept]

    def _part(self, price: float) -> None:
        """Leave out the dearer of playing on and jumping between the same two moments."""
        after = np.flatnonzero(self.joins[:, 1] == self.joins[:, 0] + 1)
        start = self.joins[after, 0]
        after = after[self.clip[start] == self.clip[start + 1]]
        play = np.searchsorted(self.plays[:, 0], self.joins[after, 0])
        jump = self.costs[after] < price * self.lasts[play]
        self.way_plays[play], self.way_joins[after] = ~jump, jump

    def __len__(self) -> int:
        return len(self.clip)

    def number(self, name: str) -> int:
        """The number of a clip."""
        return self._order[name]

    def place(self, moment: int) -> Place:
        """The clip and the time of a moment."""
        return self.names[self.clip[moment]], float(self.time[moment])

    def at(self, name: str, time: float) -> int:
        """The moment of a clip at a time that is one."""
        first, last = self._first[self.number(name) : self.number(name) + 2]
        return int(first + np.searchsorted(self.time[first:last], time))

    def joined(self, before: int, after: int) -> int | None:
        """The number of the transition from a moment to another one, if there is one."""
        key = before * len(self) + after
        i = int(np.searchsorted(self._keys, key))
        return i if i < len(self._keys) and self._keys[i] == key else None

    def transition(self, before: int, after: int) -> Transition:
        """The transition from a moment to another one."""
        number = self.joined(before, after)
        assert number is not None  # the edge was taken
        return self.transitions[number]


def strong_clips(graph: MotionGraph) -> list[str]:
    """The clips of which some part lies where one can go on for ever.

    That is the largest strongly connected component of all moments, in which playing on leads from
    a moment of a clip to the next one; none if no moment is reached again.
    """
    moments = Moments(graph)
    pairs = np.concatenate([moments.plays, moments.joins])
    size = len(moments)
    matrix = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    _, labels = connected_components(matrix, connection="strong")
    counts = np.bincount(labels)
    if counts.max() < 2:
        return []
    inside = set(moments.clip[labels == np.argmax(counts)].tolist())
    return [name for i, name in enumerate(graph.names) if i in inside]
