"""The k cheapest simple paths: all of them, in order, where cycles would give endless walks."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from poise.baselines.motion.graphs.k_best import k_best


def all_paths(costs: np.ndarray, begin: int, end: int) -> list[tuple[float, list[int]]]:
    """Every path that meets no node twice, by walking them all."""
    found, stack = [], [(0.0, [begin])]
    while stack:
        cost, nodes = stack.pop()
        if nodes[-1] == end:
            found.append((cost, nodes))
            continue
        stack += [(cost + w, [*nodes, j]) for j, w in enumerate(costs[nodes[-1]])
                  if w > 0.0 and j not in nodes]  # fmt: skip
    return sorted(found)


@pytest.mark.parametrize("seed", range(20))
def test_all_simple_paths_come_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((7, 7)) < 0.4, rng.uniform(0.1, 1.0, (7, 7)), 0.0)
    np.fill_diagonal(costs, 0.0)
    wanted = all_paths(costs, 0, 6)
    found = k_best(csr_array(costs), 0, 6, 1000)
    assert [cost for cost, _ in found] == pytest.approx([cost for cost, _ in wanted])
    assert sorted(nodes for _, nodes in found) == sorted(nodes for _, nodes in wanted)
    assert k_best(csr_array(costs), 0, 6, 2) == found[:2]


def test_equal_costs_are_all_found_and_none_is_no_path() -> None:
    square = np.array([[0, 1, 1, 0], [0, 0, 0, 1], [0, 0, 0, 1], [0, 0, 0, 0]], float)
    assert sorted(nodes for _, nodes in k_best(csr_array(square), 0, 3, 9)) == [
        [0, 1, 3],
        [0, 2, 3],
    ]
    assert k_best(csr_array(square), 3, 0, 9) == []
