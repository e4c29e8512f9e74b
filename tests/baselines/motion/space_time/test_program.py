"""The quadratic program with penalised rows against solutions in closed form."""

import numpy as np
import pytest
from scipy import sparse

from poise.baselines.motion.space_time.constraints.scene import ConstraintRows
from poise.baselines.motion.space_time.program import Penalised, Quadratic, solve_program

CLOSE = 2e-3  # of what OSQP's tolerance of 1e-4 leaves


def cost(goal: np.ndarray) -> Quadratic:
    """‖δ − goal‖² for frames of one coordinate."""
    n = len(goal)
    return Quadratic(2.0 * sparse.identity(n, format="csr"), -2.0 * goal,
                     sparse.identity(n, format="csr"), np.zeros(n), 1)  # fmt: skip


def at_most(frame: int, value: float, weight: float) -> Penalised:
    rows = ConstraintRows(
        {frame: np.ones((1, 1))}, np.zeros(1), np.array([-np.inf]), np.array([value])
    )
    return Penalised(rows, weight)


def solve(goal: np.ndarray, penalised: list[Penalised], bound: float = 10.0) -> np.ndarray:
    n = len(goal)
    found = solve_program(
        cost(goal), np.arange(n), np.full(n, -bound), np.full(n, bound), penalised
    )
    assert found is not None
    return found


@pytest.mark.parametrize(("weight", "answer"), [(10.0, 0.3), (0.5, 0.75), (1e-3, 1.0 - 5e-4)])
def test_a_penalty_is_exact_above_the_multiplier(weight: float, answer: float) -> None:
    """min (δ − 1)² + w max(δ − 0.3, 0): δ = max(0.3, 1 − w/2)."""
    assert solve(np.ones(1), [at_most(0, 0.3, weight)]) == pytest.approx([answer], abs=CLOSE)


def test_bounds_are_hard() -> None:
    assert solve(np.array([3.0, -3.0]), [], 0.5) == pytest.approx([0.5, -0.5], abs=CLOSE)
    assert solve(np.ones(1), [at_most(0, -1.0, 50.0)], 0.5) == pytest.approx([-0.5], abs=CLOSE)


def test_rows_of_a_group_share_a_place() -> None:
    """δ₀ = δ₁ = δ₂ = y at the mean of the goals; the values that they begin with count."""
    goal, begun = np.array([0.0, 0.3, 0.9]), np.array([0.0, 0.1, -0.1])
    zero = np.zeros(1)
    rows = []
    for f in range(3):
        group = ConstraintRows({f: np.ones((1, 1))}, begun[f : f + 1], zero, zero, True)
        rows.append(Penalised(group, 50.0, 4))
    place = solve(goal, rows) + begun
    assert place == pytest.approx(np.full(3, np.mean(goal + begun)), abs=CLOSE)


def test_rows_of_two_frames() -> None:
    """|δ₁ − δ₀| ≤ 0.2 takes as much from either."""
    rows = ConstraintRows({0: -np.ones((1, 1)), 1: np.ones((1, 1))}, np.zeros(1), np.array([-0.2]),
                np.array([0.2]))  # fmt: skip
    found = solve(np.array([0.0, 1.0]), [Penalised(rows, 50.0)])
    assert found == pytest.approx([0.4, 0.6], abs=CLOSE)
