"""OSQP, an operator-splitting method [Stellato20], behind the solver interface.

OSQP is a first-order method: the problem must be well scaled. A change of variables leaves its
iteration all but unchanged; what counts is the relative length of the rows of C, and how nearly
the active ones depend on each other in the metric of H⁻¹. Rows of unit length in the given
variables do well; in the metric of H⁻¹ they took ten times the iterations on the momentum QP.
"""

import time
from dataclasses import asdict, dataclass, field

import numpy as np
import osqp
from scipy import sparse
from scipy.linalg import solve_triangular

from .problem import QP, Solution, Status, failed, refusal, residuals, uncopyable

STATUS = {  # of OSQP's status_val; what is not here is a breakdown
    osqp.SolverStatus.OSQP_SOLVED: Status.SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE: Status.INACCURATE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED: Status.ITERATION_LIMIT,
}


@dataclass(frozen=True)
class OSQPOptions:
    """OSQP's own settings; `accept_inaccurate` takes "solved inaccurate" (within ten times the
    tolerances at the iteration limit) for solved. `adaptive_rho_interval` is in iterations, so
    that the result does not depend on the time."""

    eps_abs: float = field(default=1e-4, metadata={"above": 0.0})
    eps_rel: float = field(default=1e-4, metadata={"above": 0.0})
    max_iter: int = field(default=4000, metadata={"min": 1})
    check_termination: int = field(default=10, metadata={"min": 1})
    rho: float = field(default=0.1, metadata={"above": 0.0})
    sigma: float = field(default=1e-6, metadata={"above": 0.0})
    alpha: float = field(default=1.6, metadata={"above": 0.0, "max": 2.0})
    adaptive_rho_interval: int = field(default=50, metadata={"min": 1})
    scaling: int = field(default=10, metadata={"min": 0})
    polishing: bool = True
    warm_start: bool = True
    accept_inaccurate: bool = False


class OSQPSolver:
    """Keeps one OSQP workspace, with a dense pattern, as long as the shape stays the same."""

    def __init__(self, options: OSQPOptions | None = None):
        self.options = options or OSQPOptions()
        self.reset()

    def __getstate__(self) -> dict[str, object]:
        if self._solver is not None:
            raise uncopyable("osqp")
        return vars(self).copy()

    def reset(self) -> None:
        """Forget the workspace: the last solution and the step size."""
        self._solver: osqp.OSQP | None = None
        self._last: tuple[np.ndarray, np.ndarray] | None = None  # x and lam

    def solve(self, qp: QP) -> Solution:
        start = time.perf_counter()
        status = refusal(qp)
        if status is not None:
            return failed(qp, status, start)
        try:
            L = np.linalg.cholesky(qp.H)  # OSQP itself refuses a clearly indefinite H only
        except np.linalg.LinAlgError:
            return failed(qp, Status.INVALID, start)
        length = np.linalg.norm(qp.C, axis=1)
        scale = 1.0 / np.where(length > 0.0, length, 1.0)
        try:
            solver = self._load(qp, scale)
            if self.options.warm_start and self._last is not None:
                solver.warm_start(self._last[0], self._last[1] / scale)
            result = solver.solve(raise_error=False)
        except (osqp.OSQPException, ValueError):  # both for data that it refuses
            self.reset()
            return failed(qp, Status.INVALID, start)

        iterations = int(result.info.iter)
        status = STATUS.get(result.info.status_val, Status.INVALID)
        if status is Status.INACCURATE and self.options.accept_inaccurate:
            status = Status.SOLVED
        if status is not Status.SOLVED:
            self.reset()
            return failed(qp, status, start, iterations)
        x, lam = np.array(result.x), scale * result.y
        self._last = x, lam
        if self.options.polishing:
            x, lam = polish(qp, L, x, lam)
        return Solution(x.copy(), lam.copy(), status, iterations, time.perf_counter() - start)

    def _load(self, qp: QP, scale: np.ndarray) -> osqp.OSQP:
        """The workspace with this problem in it, its rows scaled."""
        m, n = qp.C.shape
        # row by row of one triangle, column by column of the other
        upper = qp.H[np.tril_indices(n)]
        rows = (scale[:, None] * qp.C).ravel(order="F")
        l, u = scale * qp.l, scale * qp.u  # noqa: E741
        if self._solver is not None and (self._solver.m, self._solver.n) == (m, n):
            self._solver.update(Px=upper, Ax=rows, q=qp.g, l=l, u=u)
            return self._solver
        # The pattern is dense, whatever the values: zeros are kept, for they may change.
        triangle = np.concatenate([np.arange(j + 1) for j in range(n)])
        starts = np.arange(n + 1) * np.arange(1, n + 2) // 2
        P = sparse.csc_matrix((upper, triangle, starts), shape=(n, n))
        A = sparse.csc_matrix((rows, np.tile(np.arange(m), n), m * np.arange(n + 1)), shape=(m, n))
        settings = asdict(self.options)
        del settings["accept_inaccurate"]
        settings["warm_starting"] = settings.pop("warm_start")
        settings["polishing"] = False  # see `polish`
        self._last = None
        self._solver = osqp.OSQP()
        self._solver.setup(P=P, q=qp.g, A=A, l=l, u=u, verbose=False, **settings)
        return self._solver


def polish(qp: QP, L: np.ndarray, x: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x and lam of the equality problem on the active rows, if they are better; H = LLᵀ.

    A row is taken for active as in [Stellato20 §4]. OSQP's own polishing prints to the standard
    output (osqp issue 785) and may return a solution outside the tolerances (issue 790).
    """
    Cx = qp.C @ x
    low, high = Cx - qp.l < -lam, qp.u - Cx < lam
    active = low | high
    G = solve_triangular(L, np.column_stack([qp.g, qp.C[active].T]), lower=True)
    h, W = G[:, 0], G[:, 1:]
    bound = np.where(low, qp.l, qp.u)[active]
    polished_lam = np.zeros(len(lam))
    polished_lam[active] = np.linalg.lstsq(W.T @ W, -bound - W.T @ h, rcond=1e-12)[0]
    polished_x = -solve_triangular(L, h + W @ polished_lam[active], lower=True, trans=1)
    wrong = (low & ~high & (polished_lam > 0.0)) | (high & ~low & (polished_lam < 0.0))
    before = residuals(qp, Solution(x, lam, Status.SOLVED, 0, 0.0))
    after = residuals(qp, Solution(polished_x, polished_lam, Status.SOLVED, 0, 0.0))
    better = after.primal <= before.primal and after.dual <= before.dual
    return (polished_x, polished_lam) if better and not wrong.any() else (x, lam)
