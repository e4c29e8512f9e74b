"""The k cheapest paths of a graph that meet no node twice."""

import heapq
import itertools

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

Found = tuple[float, list[int]]  # cost, and nodes from the begin to the end


def k_best(matrix: csr_array, begin: int, end: int, k: int) -> list[Found]:
    """The k cheapest paths, the best first; fewer if there are no more.

    With d the cost that is left from each node, a path is the tree of cheapest ways followed from
    the begin, and left by edges (u, v) that cost w + d(v) − d(u) ≥ 0 more. A path that is taken
    from the queue hands in those that leave it once more; only the cheapest of them is queued
    until that is taken. Where a path meets a node again, it is only left before that.
    """
    search = _Deviations(matrix, begin, end)
    if not np.isfinite(search.left[begin]):
        return []
    queue: list[tuple[float, int, _Siblings, int]] = []
    number, found = itertools.count(), list[Found]()

    def hand_in(siblings: _Siblings, place: int) -> None:
        if place < len(siblings.costs):
            item = (float(siblings.costs[place]), next(number), siblings, place)
            heapq.heappush(queue, item)

    cost, prefix = float(search.left[begin]), np.array([begin])
    while True:
        nodes, simple = search.followed(prefix)
        if simple:
            found.append((cost, nodes.tolist()))
        if len(found) == k:
            return found
        hand_in(search.leaving(nodes, len(prefix), cost), 0)
        if not queue:
            return found
        cost, _, siblings, place = heapq.heappop(queue)
        hand_in(siblings, place + 1)
        prefix = siblings.prefix(place)


class _Siblings:
    """Paths that leave one path, in order of cost: (m,) places in it, nodes that follow, costs."""

    def __init__(self, nodes: np.ndarray, places: np.ndarray, heads: np.ndarray, costs: np.ndarray):
        self.nodes, self.places, self.heads, self.costs = nodes, places, heads, costs

    def prefix(self, number: int) -> np.ndarray:
        """The nodes of a path until it has left the other one."""
        return np.append(self.nodes[: self.places[number] + 1], self.heads[number])


class _Deviations:
    """The tree of cheapest ways to an end, and the edges that leave it."""

    def __init__(self, matrix: csr_array, begin: int, end: int):
        self.matrix, self.end = matrix, end
        self.left = dijkstra(matrix.T.tocsr(), indices=end)
        rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
        with np.errstate(invalid="ignore"):  # ∞ − ∞ of nodes from which no way leads to the end
            self.more = matrix.data + self.left[matrix.indices] - self.left[rows]
        usable = np.flatnonzero(np.isfinite(self.more))
        ranked = usable[np.lexsort((self.more[usable], rows[usable]))]
        first = np.append(True, np.diff(rows[ranked]) != 0) if len(ranked) else ranked
        self.best = np.full(matrix.shape[0], -1)  # the edge on the cheapest way from each node
        self.best[rows[ranked[first]]] = ranked[first]
        self.more[~np.isfinite(self.more)] = np.inf

    def followed(self, prefix: np.ndarray) -> tuple[np.ndarray, bool]:
        """The nodes of a path that goes on by the tree: to the end, or until it meets one again."""
        nodes, met = [int(prefix[-1])], set(prefix[:-1].tolist())
        indices, best = self.matrix.indices, self.best
        while nodes[-1] != self.end and nodes[-1] not in met:
            nodes.append(int(indices[best[nodes[-1]]]))
        whole = np.concatenate([prefix[:-1], nodes])
        return whole, nodes[-1] not in met

    def leaving(self, nodes: np.ndarray, begin: int, cost: float) -> _Siblings:
        """The paths that leave one of `cost` at its nodes number `begin` − 1 and later."""
        m = self.matrix
        places = np.arange(begin - 1, len(nodes) - 1)  # the last one ends it, or is met again
        counts = m.indptr[nodes[places] + 1] - m.indptr[nodes[places]]
        at = np.repeat(places, counts)
        within = np.arange(len(at)) - np.repeat(np.cumsum(counts) - counts, counts)
        edges = m.indptr[nodes[at]] + within
        edges, at = self._others(edges, at, nodes)
        order = np.argsort(self.more[edges], kind="stable")
        edges, at = edges[order], at[order]
        return _Siblings(nodes, at, m.indices[edges], cost + self.more[edges])

    def _others(
        self, edges: np.ndarray, at: np.ndarray, nodes: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Those that lead on, not to where the path goes, nor to a node that it has met by then."""
        kept = np.isfinite(self.more[edges]) & (edges != self.best[nodes[at]])
        edges, at = edges[kept], at[kept]
        first = {int(node): i for i, node in reversed(list(enumerate(nodes)))}
        fresh = [first.get(int(head), len(nodes)) > place
                 for head, place in zip(self.matrix.indices[edges], at, strict=True)]  # fmt: skip
        return edges[fresh], at[fresh]
