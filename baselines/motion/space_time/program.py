"""A sparse quadratic program with penalised rows, solved by OSQP."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import osqp
from scipy import sparse

from poise.baselines.motion.space_time.constraints.scene import ConstraintRows

# Prices and curvatures are some powers of ten apart. OSQP's scaling, which makes them alike, and a
# step size that follows the residuals took ten times the iterations.
OPTIONS = {"rho": 30.0, "scaling": 0, "eps_abs": 1e-4, "eps_rel": 1e-4, "max_iter": 4000,
           "check_termination": 25, "adaptive_rho_interval": 1000, "polishing": False,
           "verbose": False}  # fmt: skip
GIVEN = (osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
         osqp.SolverStatus.OSQP_MAX_ITER_REACHED)  # fmt: skip
TINY = 1e-6  # curvature of slacks and of shared places


class Penalised(NamedTuple):
    """Rows whose excess costs `weight` a unit; those of one `group` (≥ 0) share unknowns."""

    rows: ConstraintRows
    weight: float
    group: int = -1


class Quadratic(NamedTuple):
    """½ zᵀ H z + gᵀ z of the free displacements z; δ = basis z + given, nv for each frame."""

    H: sparse.csr_matrix
    g: np.ndarray
    basis: sparse.csr_matrix
    given: np.ndarray
    nv: int


def solve_program(
    cost: Quadratic, joints: np.ndarray, low: np.ndarray, high: np.ndarray,
    penalised: Sequence[Penalised],
) -> np.ndarray | None:  # fmt: skip
    """δ (F nv,) of the least cost and excess, Σ weight (s₁ + …), s.t. low ≤ δ[joints] ≤ high.

    Each penalised row has a slack: low − s ≤ f + ∂f δ − y ≤ high + s, s ≥ 0, with the places y
    that rows of a group share. None if OSQP breaks down.
    """
    n = cost.basis.shape[1]
    D, S, least, most, prices = _stacked(penalised, len(cost.given), cost.nv)
    rows, shared = S.shape
    moved, E, one = D @ cost.given, D @ cost.basis, sparse.identity(rows, format="csr")
    nothing = sparse.csr_matrix((len(joints), shared + rows))
    A = sparse.vstack(
        [
            sparse.hstack([cost.basis[joints], nothing]),
            sparse.hstack([E, S, one]),
            sparse.hstack([E, S, -one]),
            sparse.hstack([sparse.csr_matrix((rows, n + shared)), one]),
        ],
        format="csc",
    )
    endless, offset = np.full(rows, np.inf), cost.given[joints]
    P = sparse.block_diag([cost.H, TINY * sparse.identity(shared + rows)], format="csc")
    solver = osqp.OSQP()
    try:
        solver.setup(
            P=sparse.triu(P, format="csc"),
            q=np.concatenate([cost.g, np.zeros(shared), prices]),
            A=A,
            l=np.concatenate([low - offset, least - moved, -endless, np.zeros(rows)]),
            u=np.concatenate([high - offset, endless, most - moved, endless]),
            **OPTIONS,
        )
        result = solver.solve(raise_error=False)
    except (osqp.OSQPException, ValueError):
        return None
    if result.info.status_val not in GIVEN:
        return None
    return cost.basis @ np.array(result.x)[:n] + cost.given


def _stacked(
    penalised: Sequence[Penalised], size: int, nv: int
) -> tuple[sparse.csr_matrix, sparse.csr_matrix, np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of all rows by δ (m, size) and by the shared places (m, k), their bounds less
    their values, and their weights."""
    counts = [len(each.rows.value) for each in penalised]
    begins = np.concatenate([[0], np.cumsum(counts)]).astype(int)
    groups = sorted({each.group for each in penalised if each.group >= 0})
    width = {g: next(len(e.rows.value) for e in penalised if e.group == g) for g in groups}
    places = dict(zip(groups, np.cumsum([0, *width.values()])[:-1], strict=True))
    D, S = _Entries(), _Entries()
    for each, begin, count in zip(penalised, begins, counts, strict=False):
        for frame, part in each.rows.parts.items():
            D.add(begin, frame * nv, part)
        if each.group >= 0:
            S.add(begin, int(places[each.group]), -np.eye(count))
    rows = [each.rows for each in penalised]
    least = np.concatenate([np.zeros(0), *(r.low - r.value for r in rows)])
    most = np.concatenate([np.zeros(0), *(r.high - r.value for r in rows)])
    prices = np.repeat([each.weight for each in penalised], counts)
    m = int(begins[-1])
    return D.matrix(m, size), S.matrix(m, sum(width.values())), least, most, prices


class _Entries:
    """Dense blocks of a sparse matrix."""

    def __init__(self) -> None:
        self.rows, self.columns = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
        self.values = [np.zeros(0)]

    def add(self, row: int, column: int, block: np.ndarray) -> None:
        """A block with its first entry at (row, column)."""
        i, j = np.indices(block.shape)
        self.rows.append(row + i.ravel())
        self.columns.append(column + j.ravel())
        self.values.append(block.ravel())

    def matrix(self, rows: int, columns: int) -> sparse.csr_matrix:
        """The matrix (rows, columns)."""
        where = (np.concatenate(self.rows), np.concatenate(self.columns))
        entries = (np.concatenate(self.values), where)
        return sparse.coo_matrix(entries, shape=(rows, columns)).tocsr()
