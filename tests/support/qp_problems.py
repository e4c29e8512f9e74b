"""Random quadratic programs with known properties, for the tests and benchmarks of the solvers."""

from __future__ import annotations

import numpy as np

from poise.baselines.solvers import QP
from poise.baselines.solvers.dual_active_set import FEASIBLE

#: Kinds of `random_qp`; all but "crossed" are feasible.
KINDS = ("plain", "scaled", "stiff", "degenerate", "integer", "repeated", "equalities", "crossed")


def spd(rng: np.random.Generator, n: int, condition: float) -> np.ndarray:
    """A symmetric positive definite matrix (n, n) with this condition number and norm 1."""
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    H = Q * np.geomspace(1.0, 1.0 / condition, n) @ Q.T
    return (H + H.T) / 2


def solved_qp(
    rng: np.random.Generator, n: int = 21, m: int = 64, active: int = 8, condition: float = 1e3
) -> tuple[QP, np.ndarray, np.ndarray]:
    """A QP with its only solution x and multipliers lam, with this many active rows."""
    H, C, x = 1e3 * spd(rng, n, condition), rng.normal(size=(m, n)), rng.normal(size=n)
    lower, upper = C @ x - rng.uniform(0.05, 3.0, m), C @ x + rng.uniform(0.05, 3.0, m)
    lam = np.zeros(m)
    for i in rng.choice(m, active, replace=False):
        lam[i] = rng.normal() * 3
        (upper if lam[i] > 0 else lower)[i] = C[i] @ x
    return QP(H, -H @ x - C.T @ lam, C, lower, upper), x, lam


def rounding(qp: QP, x: np.ndarray, lam: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far from the solution rounding may move x (n,) and lam (m,), on any processor.

    With K = [H Cᵀ; C 0] of the q active rows and z = (x, lam), a residual of at most r moves z by
    at most |K⁻¹| r, entry by entry [Higham02 §7.2]. Sums of k = n + q products leave r = ku |K||z|
    with u = 2⁻⁵³, in whatever order they are taken, fused or not: once where the problem is made
    from z, once where the solver takes its last step with the true residual. Beside it the solver
    holds its rows to 0.01 FEASIBLE ‖x‖, each in units of its norm.
    """
    active, n = np.flatnonzero(lam), len(x)
    C, k = qp.C[active], n + len(active)
    K = np.zeros((k, k))
    K[:n, :n], K[:n, n:], K[n:, :n] = qp.H, C.T, C
    residual = 2.0 * k * 2.0**-53 * np.abs(K) @ np.abs(np.append(x, lam[active]))
    residual[n:] += 0.01 * FEASIBLE * np.linalg.norm(x) * np.linalg.norm(C, axis=1)
    moved, of_lam = np.abs(np.linalg.inv(K)) @ residual, np.zeros(len(lam))
    of_lam[active] = moved[n:]
    return moved[:n], of_lam


def random_qp(rng: np.random.Generator, kind: str, n: int, m: int) -> QP:
    """A QP of one of the KINDS, with infinite sides among the bounds.

    scaled: rows of very different length; stiff: scaled, with a condition number of 1e8;
    degenerate: many rows tight at one point; integer, repeated: also linearly dependent ones;
    equalities: n // 2 of them; crossed: bounds at random, so that it may be infeasible.
    """
    H = spd(rng, n, 1e8 if kind == "stiff" else 10 ** rng.uniform(0, 4)) * 10 ** rng.uniform(-2, 4)
    g = rng.normal(size=n) * np.abs(H).max() * 10 ** rng.uniform(-1, 2)
    C, inside = rng.normal(size=(m, n)), rng.normal(size=n)
    if kind in ("integer", "repeated"):
        C, inside = rng.integers(-2, 3, size=(m, n)).astype(float), np.round(inside)
    if kind == "repeated" and m:
        base = C[: m // 4 + 1]
        C = base[rng.integers(len(base), size=m)] * rng.choice([-1.0, 1.0, 2.0, 0.5], m)[:, None]
    if kind in ("scaled", "stiff"):
        C *= 10 ** rng.uniform(-3, 3, size=(m, 1))
    length = np.linalg.norm(C, axis=1)
    gaps = [0.01, 0.1, 1.0, 3.0, np.inf]
    if kind in ("degenerate", "integer", "repeated"):
        gaps = [0.0, 0.0, 0.1, 1.0, 3.0, np.inf]
    below, above = rng.choice(gaps, (2, m))
    if kind == "crossed":
        below, above = rng.uniform(-0.3, 1.0, (2, m))
    for gap in (below, above):
        finite = np.isfinite(gap)
        gap[finite] *= length[finite]
    lower, upper = C @ inside - below, C @ inside + above
    if kind == "crossed":
        upper = np.maximum(lower, upper)
    if kind == "equalities":
        rows = rng.permutation(m)[: n // 2]
        lower[rows] = upper[rows] = (C @ inside)[rows]
    return QP(H, g, C, lower, upper)
