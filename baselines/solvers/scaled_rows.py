"""The rows l ≤ Cx ≤ u of the dual active-set method, scaled to unit norm, compiled.

Ct = (C / row norms)ᵀ is stored by columns of C, padded to a multiple of 8 rows that nothing can
violate.
"""

import numpy as np

from poise.envs.compiled.jit import compiled

SOLVED, INFEASIBLE, ITERATION_LIMIT, INVALID = 0, 1, 2, 3  # status of `solve_dual`


@compiled
def scale_rows(
    C: np.ndarray,
    l: np.ndarray,  # noqa: E741
    u: np.ndarray,
    Ct: np.ndarray,
    scale: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
) -> int:
    """Ct (n, p) = (C / row norms)ᵀ and its bounds; returns SOLVED, INFEASIBLE or INVALID."""
    m, n = C.shape
    p = Ct.shape[1]
    status = SOLVED
    for i in range(m):
        square = 0.0
        for j in range(n):
            square += C[i, j] * C[i, j]
        if not square < np.inf or np.isnan(l[i]) or np.isnan(u[i]):
            return INVALID
        if l[i] > u[i] or l[i] == np.inf or u[i] == -np.inf:
            status = INFEASIBLE
        if square > 0.0:
            scale[i] = 1.0 / np.sqrt(square)
            lower[i] = l[i] * scale[i]
            upper[i] = u[i] * scale[i]
        else:  # 0ᵀx is 0, whatever x
            if l[i] > 0.0 or u[i] < 0.0:
                status = INFEASIBLE
            scale[i] = 0.0
            lower[i] = -np.inf
            upper[i] = np.inf
    for i in range(m, p):
        lower[i] = -np.inf
        upper[i] = np.inf
    for j in range(n):
        for i in range(m):
            Ct[j, i] = C[i, j] * scale[i]
        for i in range(m, p):
            Ct[j, i] = 0.0
    return status


@compiled
def advance_slacks(Ct: np.ndarray, z: np.ndarray, t: float, s: np.ndarray, product: np.ndarray):
    """s += t Cz."""
    n, p = Ct.shape
    for i in range(p):
        product[i] = 0.0
    for j in range(n):
        factor = t * z[j]
        for i in range(p):
            product[i] += factor * Ct[j, i]
    for i in range(p):
        s[i] += product[i]


@compiled
def most_violated(
    s: np.ndarray, lower: np.ndarray, upper: np.ndarray, violation: np.ndarray
) -> tuple[int, float]:
    """Index and violation of the most violated row; −1 and 0 if there is none."""
    for i in range(s.shape[0]):
        below, above = lower[i] - s[i], s[i] - upper[i]
        violation[i] = below if below > above else above
    row, worst = -1, 0.0
    for i in range(s.shape[0]):
        if violation[i] > worst:
            row, worst = i, violation[i]
    return row, worst
