"""QP solvers behind one call, for `qp_set`: `prepare` is not timed, `solve` is; all start cold."""

from __future__ import annotations

import importlib.util
from functools import partial
from typing import Any, NamedTuple

import daqp
import numpy as np
from scipy import sparse

from poise.baselines.solvers import QP, make_solver
from poise.baselines.solvers.dual_active_set import iscratch_size, scratch_size, solve_dual


class Answer(NamedTuple):
    """x (n,) and lam (m,), positive at an upper bound."""

    x: np.ndarray
    lam: np.ndarray


class Own:
    """A solver of Poise's own interface, its checks included."""

    def __init__(self, name: str, **options: Any):
        self.solver = make_solver(name, **options)

    def prepare(self, qp: QP) -> QP:
        self.solver.reset()
        return qp

    def solve(self, qp: QP) -> Answer | None:
        solution = self.solver.solve(qp)
        return Answer(solution.x, solution.lam) if solution.solved else None


class Compiled:
    """The active-set method called as the compiled control tick calls it."""

    def prepare(self, qp: QP) -> tuple:
        m, n = qp.C.shape
        C = np.ascontiguousarray(qp.C)
        scratch, places = np.empty(scratch_size(n, m)), np.empty(iscratch_size(n, m), np.int64)
        return qp.H, qp.g, C, qp.l, qp.u, np.zeros(n), np.zeros(m), scratch, places

    def solve(self, data: tuple) -> Answer | None:
        return Answer(data[5], data[6]) if solve_dual(*data, 500, False) == 0 else None


class DAQP:
    """Its own function, without a workspace that is kept."""

    def prepare(self, qp: QP) -> tuple:
        arrays = (qp.H, qp.g, qp.C, qp.u, qp.l)
        sense = np.where(qp.l == qp.u, 5, 0).astype(np.int32)  # 5: equality
        return *(np.array(a, dtype=float, order="C") for a in arrays), sense

    def solve(self, data: tuple) -> Answer | None:
        x, _, flag, info = daqp.solve(*data, primal_tol=1e-9, dual_tol=1e-12)
        return Answer(np.array(x), np.array(info["lam"])) if flag == 1 else None


class Parts(NamedTuple):
    """A problem with its equalities apart."""

    H: np.ndarray
    g: np.ndarray
    equal: np.ndarray  # (m,) bool
    A: np.ndarray
    b: np.ndarray
    C: np.ndarray
    l: np.ndarray  # noqa: E741
    u: np.ndarray

    @classmethod
    def of(cls, qp: QP) -> Parts:
        equal = qp.l == qp.u
        return cls(qp.H, qp.g, equal, qp.C[equal], qp.u[equal],
                   qp.C[~equal], qp.l[~equal], qp.u[~equal])  # fmt: skip

    def lam(self, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        out = np.empty(len(self.equal))
        out[self.equal], out[~self.equal] = y, z
        return out


PROXQP_ITERATIONS = 100


class ProxQP:
    def __init__(self, eps: float):
        self.eps = eps

    def prepare(self, qp: QP) -> Parts:
        return Parts.of(qp)

    def solve(self, p: Parts) -> Answer | None:
        from proxsuite import proxqp

        solver = proxqp.dense.QP(len(p.g), len(p.b), len(p.l))
        solver.settings.eps_abs, solver.settings.eps_rel = self.eps, 0.0
        solver.settings.max_iter = PROXQP_ITERATIONS  # its own limit, 10,000, can take minutes
        solver.init(p.H, p.g, p.A, p.b, p.C, p.l, p.u)
        solver.solve()
        if solver.results.info.status != proxqp.QPSolverOutput.PROXQP_SOLVED:
            return None
        return Answer(solver.results.x, p.lam(solver.results.y, solver.results.z))


class PIQP:
    prepare = staticmethod(Parts.of)

    def solve(self, p: Parts) -> Answer | None:
        import piqp

        solver = piqp.DenseSolver()
        solver.setup(p.H, p.g, p.A, p.b, p.C, p.l, p.u)
        if solver.solve() != piqp.PIQP_SOLVED:
            return None
        result = solver.result
        return Answer(result.x, p.lam(result.y, result.z_u - result.z_l))


class OneSided(NamedTuple):
    """Equalities, then G x ≤ h: upper sides, then lower ones."""

    parts: Parts
    G: np.ndarray
    h: np.ndarray
    upper: np.ndarray
    lower: np.ndarray
    native: Any  # what the solver takes

    @classmethod
    def of(cls, qp: QP) -> OneSided:
        p = Parts.of(qp)
        upper, lower = np.isfinite(p.u), np.isfinite(p.l)
        G = np.vstack([p.C[upper], -p.C[lower]])
        return cls(p, G, np.concatenate([p.u[upper], -p.l[lower]]), upper, lower, None)

    def lam(self, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        both = np.zeros(len(self.parts.l))
        both[self.upper] += z[: self.upper.sum()]
        both[self.lower] -= z[self.upper.sum() :]
        return self.parts.lam(y, both)


class Quadprog:
    def prepare(self, qp: QP) -> OneSided:
        data = OneSided.of(qp)
        p = data.parts
        matrix = np.ascontiguousarray(-np.vstack([p.A, data.G]).T)
        return data._replace(native=(p.H, -p.g, matrix, -np.concatenate([p.b, data.h]), len(p.b)))

    def solve(self, data: OneSided) -> Answer | None:
        import quadprog

        try:
            x, _, _, _, lagrangian, _ = quadprog.solve_qp(*data.native)
        except ValueError:  # it calls the problem infeasible, or P not positive definite
            return None
        k = len(data.parts.b)
        p = data.parts
        y = lagrangian[:k]
        if k:  # quadprog gives equality multipliers without their sign
            rest = p.H @ x + p.g + data.G.T @ lagrangian[k:]
            y = np.linalg.lstsq(p.A.T, -rest, rcond=None)[0]
        return Answer(x, data.lam(y, lagrangian[k:]))


class Clarabel:
    def prepare(self, qp: QP) -> OneSided:
        import clarabel

        data = OneSided.of(qp)
        p = data.parts
        rows = sparse.csc_matrix(np.vstack([p.A, data.G]))
        cones = [clarabel.ZeroConeT(len(p.b)), clarabel.NonnegativeConeT(len(data.h))]
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        upper = sparse.csc_matrix(np.triu(p.H))
        bounds = np.concatenate([p.b, data.h])
        return data._replace(native=(upper, p.g, rows, bounds, cones[len(p.b) == 0 :], settings))

    def solve(self, data: OneSided) -> Answer | None:
        import clarabel

        found = clarabel.DefaultSolver(*data.native).solve()
        if found.status != clarabel.SolverStatus.Solved:
            return None
        z, k = np.array(found.z), len(data.parts.b)
        return Answer(np.array(found.x), data.lam(z[:k], z[k:]))


def _osqp(eps: float, polishing: bool = False) -> Own:
    return Own("osqp", eps_abs=eps, eps_rel=eps, polishing=polishing)


SOLVERS = {
    "active-set, compiled call": Compiled,
    "active-set": partial(Own, "active-set"),
    "daqp, direct call": DAQP,
    "daqp": partial(Own, "daqp"),
    "osqp 1e-3": partial(_osqp, 1e-3),
    "osqp 1e-4": partial(_osqp, 1e-4),
    "osqp 1e-5": partial(_osqp, 1e-5),
    "osqp 1e-6": partial(_osqp, 1e-6),
    "osqp 1e-4, polished": partial(_osqp, 1e-4, True),
    "proxqp 1e-5": partial(ProxQP, 1e-5),
    "proxqp 1e-7": partial(ProxQP, 1e-7),
    "piqp": PIQP,
    "clarabel": Clarabel,
    "quadprog": Quadprog,
}
MODULES = {"proxqp": "proxsuite", "piqp": "piqp", "clarabel": "clarabel", "quadprog": "quadprog"}


def available(name: str) -> bool:
    """Whether the solver's package is installed."""
    module = MODULES.get(name.split()[0])
    return module is None or importlib.util.find_spec(module) is not None
