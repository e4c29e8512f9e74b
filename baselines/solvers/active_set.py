"""The compiled dual active-set method behind the solver interface."""

import time
from dataclasses import dataclass, field

import numpy as np

from .dual_active_set import iscratch_size, scratch_size, solve_dual
from .problem import QP, Solution, Status, failed

STATUS = (Status.SOLVED, Status.INFEASIBLE, Status.ITERATION_LIMIT, Status.INVALID)


@dataclass(frozen=True)
class ActiveSetOptions:
    max_iter: int = field(default=500, metadata={"min": 1})


class ActiveSetSolver:
    """Goldfarb–Idnani, exact up to rounding, always started cold: no problem affects another."""

    def __init__(self, options: ActiveSetOptions | None = None):
        self.options = options or ActiveSetOptions()
        self._shape = (-1, -1)

    def reset(self) -> None:
        """Nothing is remembered."""

    def solve(self, qp: QP) -> Solution:
        start = time.perf_counter()
        m, n = qp.C.shape
        if self._shape != (m, n):
            self._shape = (m, n)
            self._scratch = np.empty(scratch_size(n, m))
            self._iscratch = np.empty(iscratch_size(n, m), dtype=np.int64)
        arrays = [np.ascontiguousarray(a, dtype=float) for a in (qp.H, qp.g, qp.C, qp.l, qp.u)]
        x, lam = np.zeros(n), np.zeros(m)
        status = solve_dual(
            *arrays, x, lam, self._scratch, self._iscratch, self.options.max_iter, False
        )
        iterations = int(self._iscratch[0])
        if status != 0:
            return failed(qp, STATUS[status], start, iterations)
        return Solution(x, lam, STATUS[status], iterations, time.perf_counter() - start)
