"""Which parts of a motion graph reach each other: its largest strongly connected component."""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from .moments import Moments
from .motion_graph import MotionGraph
from .paths import Place


def strong_clips(graph: MotionGraph) -> list[str]:
    """The clips of which some part lies where one can go on for ever.

    That is the largest strongly connected component of all moments, in which playing on leads from
    a moment of a clip to the next one.
    """
    names = {name for name, _ in _inside(graph)}
    return [name for name in graph.names if name in names]


def _inside(graph: MotionGraph) -> set[Place]:
    """The moments of the largest component; none if no moment is reached again."""
    moments = Moments(graph)
    pairs = np.concatenate([moments.plays, moments.joins])
    size = len(moments)
    matrix = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    _, labels = connected_components(matrix, connection="strong")
    counts = np.bincount(labels)
    if counts.max() < 2:
        return set()
    return {moments.place(int(i)) for i in np.flatnonzero(labels == np.argmax(counts))}
