"""The start of the dual active-set method from the rows that the last problem had active."""

import numpy as np

from poise.envs.compiled.jit import compiled

from .factors import append, lift, remove, solve_upper, split
from .scaled_rows import advance_slacks

RESUMED = 1e-12  # squared sine (metric of H⁻¹) below which a row depends on the active ones


@compiled
def resume(
    Jt: np.ndarray,
    Rt: np.ndarray,
    Ct: np.ndarray,
    q: int,
    equalities: int,
    rows: np.ndarray,
    sides: np.ndarray,
    active: np.ndarray,
    sign: np.ndarray,
    bound: np.ndarray,
    mult: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    x: np.ndarray,
    trace: float,
    d: np.ndarray,
    z: np.ndarray,
    r: np.ndarray,
    normal: np.ndarray,
    s: np.ndarray,
    work: np.ndarray,
) -> int:
    """Make `rows` active at once and let go of those that pull; returns the number of rows.

    What is left is a start as good as any for the method: x is optimal for the rows it holds.
    """
    n = Jt.shape[0]
    for i in range(len(rows)):
        row, side = rows[i], sides[i]
        if q == n or not 0 <= row < Ct.shape[1] or not (side == 1 or side == -1):
            continue
        limit = lower[row] if side == 1 else -upper[row]
        if not limit > -np.inf:
            continue
        for j in range(n):
            normal[j] = side * Ct[j, row]
        free, square = split(Jt, q, normal, d, z)
        if free <= max(RESUMED * square, 1e-28 * trace):
            continue
        append(Jt, Rt, q, d, z, free)
        active[q], sign[q], bound[q], mult[q] = row, side, limit, 0.0
        q += 1
    while True:
        for k in range(q):
            d[k] = bound[k] - sign[k] * s[active[k]]
        lift(Jt, Rt, q, d, z)
        solve_upper(Rt, q, d, r)
        pulling = int(np.int64(-1))  # a literal would compile what it is handed to twice
        for k in range(equalities, q):
            if r[k] < 0.0 and (pulling < 0 or r[k] < r[pulling]):
                pulling = k
        if pulling < 0:
            break
        remove(Jt, Rt, q, pulling)
        q -= 1
        for k in range(pulling, q):
            active[k], sign[k], bound[k] = active[k + 1], sign[k + 1], bound[k + 1]
    for j in range(n):
        x[j] += z[j]
    for k in range(q):
        mult[k] += r[k]
        if k >= equalities:
            lower[active[k]], upper[active[k]] = -np.inf, np.inf
    s[:] = 0.0
    advance_slacks(Ct, x, 1.0, s, work)
    return q
