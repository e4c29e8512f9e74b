"""OSQP, an operator-splitting method [Stellato20], behind the solver interface."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import osqp
from scipy import sparse

from .problem import QP, Solution, Status, failed, refusal

STATUS = {  # of OSQP's status_val; what is not here is a breakdown
    osqp.SolverStatus.OSQP_SOLVED: Status.SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE: Status.INACCURATE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED: Status.ITERATION_LIMIT,
}


@dataclass(frozen=True)
class OSQPOptions:
    """OSQP's own settings, for the scaled problem; `accept_inaccurate` takes "solved inaccurate"
    (within ten times the tolerances at the iteration limit) for solved."""

    eps_abs: float = field(default=1e-5, metadata={"above": 0.0})
    eps_rel: float = field(default=1e-5, metadata={"above": 0.0})
    max_iter: int = field(default=4000, metadata={"min": 1})
    check_termination: int = field(default=10, metadata={"min": 1})
    rho: float = field(default=0.1, metadata={"above": 0.0})
    sigma: float = field(default=1e-6, metadata={"above": 0.0})
    alpha: float = field(default=1.6, metadata={"above": 0.0, "max": 2.0})
    adaptive_rho_interval: int = field(default=50, metadata={"min": 1})  # iterations, not time
    scaling: int = field(default=10, metadata={"min": 0})
    polishing: bool = True
    warm_start: bool = True
    accept_inaccurate: bool = False


class OSQPSolver:
    """Keeps one OSQP workspace, with a dense pattern, as long as the shape stays the same.

    OSQP is a first-order method and wants a well scaled problem, and its tolerances are absolute.
    So it gets, in x = Dσy with D = diag(H)^(−½) and σ = ‖Dg‖∞,

        min ½ yᵀ(DHD)y + (Dg/σ)ᵀy   s.t.   El/σ ≤ (ECD)y ≤ Eu/σ,

    where E makes the rows of ECD unit vectors: a Hessian of unit diagonal, no units anywhere.
    """

    def __init__(self, options: OSQPOptions | None = None):
        self.options = options or OSQPOptions()
        self.reset()

    def reset(self) -> None:
        """Forget the workspace, with its step size, and the last solution."""
        self._solver: osqp.OSQP | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None  # x and lam

    def solve(self, qp: QP) -> Solution:
        start = time.perf_counter()
        status = refusal(qp)
        if status is not None:
            return failed(qp, status, start)
        try:
            np.linalg.cholesky(qp.H)  # OSQP itself finds out about a clearly indefinite H only
        except np.linalg.LinAlgError:
            return failed(qp, Status.INVALID, start)

        D = 1.0 / np.sqrt(np.diagonal(qp.H))
        g = D * qp.g
        size = np.abs(g).max() or 1.0
        C = qp.C * D
        norm = np.sqrt(np.einsum("ij,ij->i", C, C))
        E = 1.0 / np.where(norm > 0.0, norm, 1.0)
        scaled = QP(
            D[:, None] * qp.H * D, g / size, E[:, None] * C, E / size * qp.l, E / size * qp.u
        )

        try:
            solver = self._load(scaled)
            if self.options.warm_start and self._last is not None:
                x, lam = self._last
                solver.warm_start(x / (D * size), lam / (E * size))
            result = solver.solve(raise_error=False)
        except (osqp.OSQPException, ValueError):  # both for data that it refuses
            self.reset()
            return failed(qp, Status.INVALID, start)

        status = STATUS.get(result.info.status_val, Status.INVALID)
        if status is Status.INACCURATE and self.options.accept_inaccurate:
            status = Status.SOLVED
        if status is not Status.SOLVED:
            self.reset()
            return failed(qp, status, start, result.info.iter)
        self._last = D * size * result.x, E * size * result.y
        x, lam = self._last
        return Solution(x.copy(), lam.copy(), status, result.info.iter, time.perf_counter() - start)

    def _load(self, qp: QP) -> osqp.OSQP:
        m, n = qp.C.shape
        H_values = qp.H[np.tril_indices(n)]  # rows of the lower are columns of the upper triangle
        C_values = qp.C.ravel(order="F")
        if self._solver is not None and (self._solver.m, self._solver.n) == (m, n):
            self._solver.update(Px=H_values, Ax=C_values, q=qp.g, l=qp.l, u=qp.u)
            return self._solver
        self._last = None
        self._solver = osqp.OSQP()
        self._solver.setup(
            P=_csc(H_values, [np.arange(j + 1) for j in range(n)], (n, n)),
            q=qp.g,
            A=_csc(C_values, [np.arange(m)] * n, (m, n)),
            l=qp.l,
            u=qp.u,
            verbose=False,
            **self._settings(),
        )
        return self._solver

    def _settings(self) -> dict[str, Any]:
        own = ("warm_start", "accept_inaccurate")
        settings = {k: v for k, v in vars(self.options).items() if k not in own}
        return {**settings, "adaptive_rho": 1, "warm_starting": self.options.warm_start}


def _csc(values: np.ndarray, rows: list[np.ndarray], shape: tuple[int, int]) -> sparse.csc_matrix:
    """A matrix whose pattern is `rows` of each column, whatever the values: zeros are kept."""
    ends = np.cumsum([0] + [len(column) for column in rows])
    return sparse.csc_matrix((values, np.concatenate(rows), ends), shape=shape)
