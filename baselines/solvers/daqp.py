"""DAQP, a dual active-set method in C [Arnstrom22], behind the solver interface."""

import time
from dataclasses import dataclass, field

import daqp
import numpy as np

from .problem import QP, Solution, Status, failed, refusal, uncopyable

EQUALITY = 5  # DAQP's `sense` of a row
STATUS = {  # of its exit flags; what is not here is a breakdown
    1: Status.SOLVED,
    -1: Status.INFEASIBLE,
    -2: Status.ITERATION_LIMIT,  # it cycles
    -4: Status.ITERATION_LIMIT,
}


@dataclass(frozen=True)
class DAQPOptions:
    """Tolerances as DAQP has them, for rows of unit norm; `warm_start` from the last active set."""

    primal_tol: float = field(default=1e-9, metadata={"above": 0.0})
    dual_tol: float = field(default=1e-12, metadata={"above": 0.0})
    max_iter: int = field(default=1000, metadata={"min": 2})
    warm_start: bool = True


class DAQPSolver:
    """Keeps one DAQP workspace as long as the shape and the kinds of the bounds stay the same.

    (A warm start that holds a row at a bound which has become infinite fails.)
    """

    def __init__(self, options: DAQPOptions | None = None):
        self.options = options or DAQPOptions()
        self.reset()

    def __getstate__(self) -> dict[str, object]:
        if self._model is not None and self.options.warm_start:
            raise uncopyable("daqp")
        return {**vars(self), "_model": None, "_data": ()}

    def reset(self) -> None:
        """Forget the active set."""
        self._model: daqp.Model | None = None
        self._kinds = np.empty(0)
        self._data: tuple[np.ndarray, ...] = ()  # the workspace points into these arrays

    def solve(self, qp: QP) -> Solution:
        start = time.perf_counter()
        status = refusal(qp)
        if status is not None:
            return failed(qp, status, start)
        flag = self._load(qp)
        iterations = 0
        if flag >= 0:
            assert self._model is not None
            x, _, flag, info = self._model.solve()
            iterations = info["iterations"]
        status = STATUS.get(flag, Status.INVALID)
        if status is not Status.SOLVED:
            self.reset()
            return failed(qp, status, start, iterations)
        lam = np.array(info["lam"])
        return Solution(np.array(x), lam, status, iterations, time.perf_counter() - start)

    def _load(self, qp: QP) -> int:
        """Hands the problem over; returns DAQP's flag, negative if it refuses."""
        equality = qp.l == qp.u
        kinds = np.concatenate([equality, np.isinf(qp.l), np.isinf(qp.u)])
        same = self._model is not None and self._data[0].shape == qp.H.shape
        same = same and np.array_equal(kinds, self._kinds)
        arrays = (qp.H, qp.g, qp.C, qp.u, qp.l)
        self._data = tuple(np.array(a, dtype=float, order="C") for a in arrays)
        if self._model is not None and same and self.options.warm_start:
            H, g, C, u, l = self._data  # noqa: E741
            return self._model.update(H=H, f=g, A=C, bupper=u, blower=l)
        self._kinds = kinds
        self._model = daqp.Model()
        self._model.settings = {
            "primal_tol": self.options.primal_tol,
            "dual_tol": self.options.dual_tol,
            "iter_limit": self.options.max_iter,
        }
        return self._model.setup(*self._data, np.where(equality, EQUALITY, 0).astype(np.int32))[0]
