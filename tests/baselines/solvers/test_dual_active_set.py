"""The compiled dual active-set method against optimality conditions and other solvers."""

from __future__ import annotations

import numpy as np
import pytest
import quadprog
from scipy.optimize import linprog

from poise.baselines.solvers import QP
from poise.baselines.solvers.dual_active_set import (
    CONSISTENT,
    INFEASIBLE,
    INVALID,
    ITERATION_LIMIT,
    SOLVED,
    iscratch_size,
    scratch_size,
    solve_dual,
)
from tests.support.qp_problems import KINDS, random_qp, rounding, solved_qp


def run(qp: QP, max_iter: int = 1000, offset: int = 0):
    """Status, x, lam, iterations and active rows, with NaN in the scratch before."""
    m, n = qp.C.shape
    scratch = np.full(scratch_size(n, m) + offset, np.nan)[offset:]
    iscratch = np.full(iscratch_size(n, m), -1, dtype=np.int64)
    x, lam = np.full(n, np.nan), np.full(m, np.nan)
    status = solve_dual(qp.H, qp.g, qp.C, qp.l, qp.u, x, lam, scratch, iscratch, max_iter, False)
    return status, x, lam, iscratch[0], iscratch[2 : 2 + iscratch[1]]


def optimality(qp: QP, x, lam) -> float:
    """Largest relative residual of the KKT conditions, each against the size of its terms."""
    length = np.linalg.norm(qp.C, axis=1) + 1e-300
    violation = np.maximum(qp.l - qp.C @ x, qp.C @ x - qp.u) / length
    size = np.linalg.norm(x) + 1e-9
    primal = max(violation.max(initial=0.0), 0.0) / size
    terms = np.abs(qp.H) @ np.abs(x) + np.abs(qp.g) + np.abs(qp.C.T) @ np.abs(lam)
    dual = np.abs(qp.H @ x + qp.g + qp.C.T @ lam).max() / terms.max()
    held = lam != 0.0
    bound = np.where(lam > 0, qp.u, qp.l)
    slack = np.abs(qp.C @ x - bound)[held] / (length * size + np.abs(bound))[held]
    return max(primal, dual, slack.max(initial=0.0))


def smallest_violation(qp: QP) -> float:
    """The largest violation (of rows of unit norm) that no x can avoid, by linear programming."""
    A = np.vstack([qp.C, -qp.C])
    b = np.concatenate([qp.u, -qp.l])
    A, b = A[np.isfinite(b)], b[np.isfinite(b)]
    n = A.shape[1]
    relax = np.hstack([A, -np.linalg.norm(A, axis=1, keepdims=True)])
    return linprog(np.eye(n + 1)[n], relax, b, bounds=[(None, None)] * n + [(0, None)]).fun


@pytest.mark.parametrize("kind", KINDS)
def test_solutions_are_optimal_and_infeasibility_is_true(kind):
    """Every solution meets the KKT conditions; a problem called infeasible has no solution."""
    refused = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        qp = random_qp(rng, kind, n=int(rng.integers(1, 25)), m=int(rng.integers(0, 80)))
        status, x, lam, _, active = run(qp)
        assert status in ((SOLVED, INFEASIBLE) if kind == "crossed" else (SOLVED,)), seed
        if status == SOLVED:
            assert optimality(qp, x, lam) < 1e-9, seed
            assert set(np.flatnonzero(lam)) <= set(active) and len(set(active)) == len(active)
        else:
            refused += 1
            assert smallest_violation(qp) > 1e-7, seed
    assert (30 < refused < 120) == (kind == "crossed")


def assert_close(qp: QP, found, expected, computed: int = 1):
    """(x, lam) differ by no more than rounding accounts for; `computed`: how many of both are."""
    for one, other, bound in zip(found, expected, rounding(qp, *expected), strict=True):
        assert (np.abs(one - other) <= computed * bound).all(), (one - other, bound)


def test_known_solutions_are_found():
    """Where the solution is known by construction, x and lam are it, up to rounding.

    With as many active rows as variables K has a condition number of up to 3e9, and multipliers
    move by 1e-8 where a processor adds in another order.
    """
    for seed in range(100):
        rng = np.random.default_rng(seed)
        qp, x, lam = solved_qp(rng, active=int(rng.integers(0, 22)))
        status, x_found, lam_found, _, _ = run(qp)
        assert status == SOLVED
        assert_close(qp, (x_found, lam_found), (x, lam))


def test_quadprog_agrees():
    """An independent implementation of the method finds the same x and multipliers."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        qp, _, _ = solved_qp(rng, n=12, m=30, active=6)
        rows, bounds = np.vstack([qp.C, -qp.C]), np.concatenate([qp.l, -qp.u])
        x, _, _, _, multipliers, _ = quadprog.solve_qp(qp.H, -qp.g, rows.T.copy(), bounds)
        _, x_found, lam_found, _, _ = run(qp)
        np.testing.assert_allclose(x_found, x, atol=1e-9)
        np.testing.assert_allclose(lam_found, multipliers[30:] - multipliers[:30], atol=1e-7)


def test_signs_of_multipliers():
    """Pushing against an upper bound makes lam positive, against a lower bound negative."""
    H, C = np.eye(2), np.diag([1.0, 2.0])
    qp = QP(H, np.array([-3.0, 3.0]), C, np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    status, x, lam, _, active = run(qp)
    assert status == SOLVED and set(active) == {0, 1}
    np.testing.assert_allclose(x, [1.0, -0.5])
    np.testing.assert_allclose(lam, [2.0, -1.25])


def test_without_rows_it_is_the_linear_solve():
    """m = 0 gives −H⁻¹g, and so do rows that are infinite on both sides."""
    rng = np.random.default_rng(0)
    qp, _, _ = solved_qp(rng, n=9, m=5, active=3)
    free = QP(qp.H, qp.g, qp.C, np.full(5, -np.inf), np.full(5, np.inf))
    empty = QP(qp.H, qp.g, np.zeros((0, 9)), np.zeros(0), np.zeros(0))
    for problem in (free, empty):
        status, x, _, iterations, active = run(problem)
        assert status == SOLVED and iterations == 0 and len(active) == 0
        np.testing.assert_allclose(x, -np.linalg.solve(qp.H, qp.g), rtol=1e-10)


def test_one_variable():
    """n = 1 with many rows: the tightest bounds hold; crossing ones are infeasible."""
    H, g, C = np.eye(1), np.array([-10.0]), np.array([[1.0], [2.0], [-4.0]])
    lower, upper = np.full(3, -np.inf), np.array([5.0, 8.0, np.inf])
    status, x, lam, _, _ = run(QP(H, g, C, lower, upper))
    assert status == SOLVED and x == pytest.approx([4.0]) and lam == pytest.approx([0, 3, 0])
    upper[2] = -20.0  # x ≥ 5
    assert run(QP(H, g, C, lower, upper))[0] == INFEASIBLE


def test_dependent_equalities():
    """A repeated equality is skipped if it agrees with the first and infeasible if it does not."""
    H, g = np.eye(3), np.ones(3)
    C = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [1.0, 0.0, 1.0]])
    b = np.array([1.0, 2.0, 0.5])
    status, x, lam, _, active = run(QP(H, g, C, b, b))
    assert status == SOLVED and len(active) == 2
    np.testing.assert_allclose(C @ x, b, atol=1e-12)
    np.testing.assert_allclose(x + g + C.T @ lam, 0.0, atol=1e-12)
    b = np.array([1.0, 2.1, 0.5])
    assert run(QP(H, g, C, b, b))[0] == INFEASIBLE


def test_rows_of_zeros():
    """0ᵀx within its bounds does nothing; bounds that exclude 0 are infeasible."""
    rng = np.random.default_rng(1)
    qp, x, _ = solved_qp(rng, n=5, m=8, active=2)
    C = np.vstack([qp.C, np.zeros(5)])
    lower, upper = np.append(qp.l, -1.0), np.append(qp.u, 0.0)
    status, x_found, _, _, _ = run(QP(qp.H, qp.g, C, lower, upper))
    assert status == SOLVED
    np.testing.assert_allclose(x_found, x, atol=1e-10)
    lower[-1], upper[-1] = 0.5, 1.0
    assert run(QP(qp.H, qp.g, C, lower, upper))[0] == INFEASIBLE


@pytest.mark.parametrize(
    ("lower", "upper"), [(1.0, 0.0), (np.inf, np.inf), (-np.inf, -np.inf)], ids=str
)
def test_impossible_bounds(lower, upper):
    """Crossed bounds and bounds at the wrong infinity are infeasible."""
    qp, _, _ = solved_qp(np.random.default_rng(0))
    qp.l[3], qp.u[3] = lower, upper
    assert run(qp)[0] == INFEASIBLE


@pytest.mark.parametrize(
    ("name", "value"),
    [(name, value) for name in "HgC" for value in (np.nan, np.inf, -np.inf)]
    + [("l", np.nan), ("u", np.nan)],
)
def test_numbers_that_are_not_finite(name, value):
    """NaN anywhere is invalid and ends at once; so is infinity, except in the bounds."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        qp, _, _ = solved_qp(rng, n=7, m=11, active=3)
        array = getattr(qp, name)
        where = tuple(rng.integers(size) for size in array.shape)
        array[where] = value
        if name == "H":
            array[where[::-1]] = value
        status, _, _, iterations, _ = run(qp)
        assert status == INVALID and iterations == 0, where


def test_hessians_that_are_not_positive_definite():
    """Indefinite, singular and zero Hessians are refused."""
    qp, _, _ = solved_qp(np.random.default_rng(0), n=6, m=10, active=2)
    eigenvalues, vectors = np.linalg.eigh(qp.H)
    for smallest in (-1.0, 0.0):
        eigenvalues[0] = smallest
        H = vectors * eigenvalues @ vectors.T
        assert run(QP((H + H.T) / 2, qp.g, qp.C, qp.l, qp.u))[0] == INVALID
    assert run(QP(0.0 * qp.H, qp.g, qp.C, qp.l, qp.u))[0] == INVALID


def test_iteration_limit():
    """It stops at the limit and says so; the limit it needs is enough."""
    qp, _, _ = solved_qp(np.random.default_rng(0))
    needed = run(qp)[3]
    assert needed >= 8
    status, _, _, iterations, _ = run(qp, max_iter=needed - 1)
    assert status == ITERATION_LIMIT and iterations == needed - 1
    assert run(qp, max_iter=needed)[0] == SOLVED


def test_same_bits_twice_at_any_alignment():
    """The result depends on the problem alone, not on old scratch or where it lies."""
    for seed in range(20):
        qp, _, _ = solved_qp(np.random.default_rng(seed))
        _, x, lam, _, _ = run(qp)
        for offset in range(8):
            _, x_again, lam_again, _, _ = run(qp, offset=offset)
            assert x.tobytes() == x_again.tobytes() and lam.tobytes() == lam_again.tobytes()


def test_inputs_are_left_alone():
    """Nothing of the problem is written to."""
    qp, _, _ = solved_qp(np.random.default_rng(0))
    before = [array.copy() for array in vars(qp).values()]
    assert run(qp)[0] == SOLVED
    for array, copy in zip(vars(qp).values(), before, strict=True):
        assert array.tobytes() == copy.tobytes()


@pytest.mark.parametrize(("n", "m"), [(1, 0), (1, 1), (7, 3), (8, 8), (9, 17), (21, 64), (24, 80)])
def test_scratch_is_large_enough(n, m):
    """Nothing is written outside the scratch that was asked for, wherever it lies."""
    for offset in range(8):
        qp = random_qp(np.random.default_rng(offset), "degenerate", n, m)
        sizes = scratch_size(n, m), iscratch_size(n, m)
        memory = np.full(sizes[0] + 80, 7.25)
        imemory = np.full(sizes[1] + 80, 725)
        scratch = memory[40 + offset : 40 + offset + sizes[0]]
        iscratch = imemory[40 : 40 + sizes[1]]
        x, lam = np.zeros(n), np.zeros(m)
        solve_dual(qp.H, qp.g, qp.C, qp.l, qp.u, x, lam, scratch, iscratch, 500, False)
        assert (memory[: 40 + offset] == 7.25).all()
        assert (memory[40 + offset + sizes[0] :] == 7.25).all()
        assert (imemory[:40] == 725).all() and (imemory[40 + sizes[1] :] == 725).all()


def test_units_do_not_matter():
    """Scaling the objective, the rows or all variables scales the solution, no more."""
    for seed in range(20):
        qp, x, lam = solved_qp(np.random.default_rng(seed))
        status, x_found, lam_found, _, _ = run(QP(1e6 * qp.H, 1e6 * qp.g, qp.C, qp.l, qp.u))
        assert status == SOLVED and np.allclose(x_found, x) and np.allclose(lam_found, 1e6 * lam)
        rows = 10.0 ** np.random.default_rng(seed).integers(-6, 7, len(lam))
        scaled = QP(qp.H, qp.g, rows[:, None] * qp.C, rows * qp.l, rows * qp.u)
        status, x_found, lam_found, _, _ = run(scaled)
        assert status == SOLVED and np.allclose(x_found, x) and np.allclose(rows * lam_found, lam)
        small = QP(qp.H, 1e-9 * qp.g, qp.C, 1e-9 * qp.l, 1e-9 * qp.u)
        status, x_found, _, _, _ = run(small)
        assert status == SOLVED and np.allclose(1e9 * x_found, x)


def solve_warm(qp: QP, iscratch: np.ndarray):
    """Status, x and lam of a warm start from this memory of the last call."""
    m, n = qp.C.shape
    x, lam, scratch = np.zeros(n), np.zeros(m), np.empty(scratch_size(n, m))
    arrays = (qp.H, qp.g, qp.C, qp.l, qp.u)
    return solve_dual(*arrays, x, lam, scratch, iscratch, 1000, True), x, lam


@pytest.mark.parametrize("kind", KINDS)
def test_a_warm_start_changes_nothing_but_the_way(kind):
    """Whatever rows are tried first, also senseless ones, the outcome is that of a cold start."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        n, m = int(rng.integers(1, 25)), int(rng.integers(1, 80))
        qp = random_qp(rng, kind, n, m)
        status, x, _, _, active = run(qp)
        # rows are held to CONSISTENT; a gradient whose sums of k products are rounded moves x by
        # 2ku cond(H), see `rounding`: 1e-6 for "stiff", where adding in another order shows
        close = CONSISTENT + 2 * (n + len(active)) * 2.0**-53 * np.linalg.cond(qp.H)
        iscratch = rng.integers(-2, m + 2, iscratch_size(n, m))
        iscratch[1] = rng.integers(-1, n + 2)
        for _ in range(3):  # at random first, then from its own solution
            warm_status, x_warm, lam_warm = solve_warm(qp, iscratch)
            assert warm_status == status, seed
            if status == SOLVED:
                assert optimality(qp, x_warm, lam_warm) < 1e-9, seed
                np.testing.assert_allclose(x_warm, x, rtol=0, atol=close * (1e-9 + abs(x).max()))


def test_a_warm_start_saves_iterations():
    """On a problem that drifts, the last active rows halve the iterations; x is the same."""
    cold = warm = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        qp, _, _ = solved_qp(rng)
        drift, iscratch = rng.normal(size=21), np.zeros(iscratch_size(21, 64), dtype=np.int64)
        for step in range(10):
            moved = QP(qp.H, qp.g + 0.2 * step * drift, qp.C, qp.l, qp.u)
            _, x, lam, iterations, _ = run(moved)
            _, x_warm, lam_warm = solve_warm(moved, iscratch)
            np.testing.assert_allclose(x_warm, x, rtol=0, atol=1e-11)
            np.testing.assert_allclose(lam_warm, lam, rtol=0, atol=1e-9)
            cold, warm = cold + iterations, warm + iscratch[0]
    assert warm < 0.7 * cold


def test_forgetting_makes_a_warm_start_cold():
    """With iscratch[1] = 0 the bits are those of a cold start."""
    qp, _, _ = solved_qp(np.random.default_rng(0))
    iscratch = np.zeros(iscratch_size(21, 64), dtype=np.int64)
    solve_warm(qp, iscratch)
    iscratch[1] = 0
    _, x, lam = solve_warm(qp, iscratch)
    assert x.tobytes() == run(qp)[1].tobytes() and lam.tobytes() == run(qp)[2].tobytes()


def test_a_skipped_row_is_looked_at_again():
    """A row that is met (to 1e-9) because of another must still hold when that one is dropped."""
    C = np.array(
        [[1.0, 0.0], [-1.0, 0.0], [0.6, 0.8]]
    )  # x₁ ≤ 1, x₁ ≥ 1 + 1e-10, 0.6x₁ + 0.8x₂ ≤ −1
    upper = np.array([1.0, -1.0 - 1e-10, -1.0])
    qp = QP(np.eye(2), np.array([-2.0, -0.5]), C, np.full(3, -np.inf), upper)
    iscratch = np.zeros(iscratch_size(2, 3), dtype=np.int64)
    iscratch[1:4] = 2, 0, 1  # first row 0, then row 1, which is skipped; row 2 makes row 0 drop
    status, x, _ = solve_warm(qp, iscratch)
    assert status == SOLVED
    np.testing.assert_allclose(x, [1.0, -2.0], atol=1e-9)
