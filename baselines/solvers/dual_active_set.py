"""Goldfarb–Idnani dual active-set method [Goldfarb83], compiled, without allocation.

    min ½ xᵀHx + gᵀx   s.t.   l ≤ Cx ≤ u

The method starts at the unconstrained minimum and adds violated rows one at a time, dropping rows
whose multiplier would change sign, so that every iterate is optimal for the rows it holds. Rows
are scaled to unit norm, so that one tolerance serves rows of any unit.
"""

import numpy as np

from poise.envs.compiled.jit import compiled

from .factors import append, factorise, lift, padded, remove, solve_upper, split
from .scaled_rows import (
    INFEASIBLE,
    INVALID,
    ITERATION_LIMIT,
    SOLVED,
    advance_slacks,
    most_violated,
    scale_rows,
)
from .warm_start import resume

FEASIBLE = 1e-11  # accepted violation of a scaled row, relative to ‖x‖
ROUNDING = 1e-13  # the same, relative to the unconstrained ‖x‖, before correction
CONSISTENT = 1e-9  # the same as FEASIBLE, for a row that depends on the active rows
DEPENDENT = 1e-20  # squared sine (metric of H⁻¹) below which a row depends on the active ones
BLOCKS = 1e-13  # smallest multiplier direction that can block a step, relative to the largest
ALIGNMENT = 8  # of the rows of the factors, in float64: unaligned ones cost a quarter more time
CHECKS = 20  # times that a finished solution may be found wanting and taken up again


@compiled
def scratch_size(n: int, m: int) -> int:
    """Number of float64 that `solve_dual` needs for n variables and m rows."""
    return ALIGNMENT + (2 * n + 6) * padded(n) + (n + 5) * padded(m)


@compiled
def iscratch_size(n: int, m: int) -> int:
    """Number of int64 that `solve_dual` needs for n variables and m rows."""
    return 2 + 4 * n


@compiled
def _size(x: np.ndarray, start: float) -> float:
    """‖x‖, and where x is all but zero a trace of ‖x‖ at the unconstrained minimum."""
    total = 0.0
    for j in range(x.shape[0]):
        total += x[j] * x[j]
    return np.sqrt(total) + 1e-9 * start


@compiled
def _correct(
    Jt: np.ndarray,
    Rt: np.ndarray,
    Ct: np.ndarray,
    q: int,
    active: np.ndarray,
    sign: np.ndarray,
    bound: np.ndarray,
    x: np.ndarray,
    start: float,
    e: np.ndarray,
    z: np.ndarray,
    s: np.ndarray,
    product: np.ndarray,
):
    """Recomputes s from x and takes out of both what rounding has left on the active rows."""
    for _ in range(3):
        s[:] = 0.0
        advance_slacks(Ct, x, 1.0, s, product)
        worst = 0.0
        for k in range(q):
            e[k] = bound[k] - sign[k] * s[active[k]]
            worst = max(worst, abs(e[k]))
        if worst <= 0.01 * FEASIBLE * _size(x, start):
            break
        lift(Jt, Rt, q, e, z)
        for j in range(x.shape[0]):
            x[j] += z[j]


@compiled
def _step_length(
    r: np.ndarray, mult: np.ndarray, equalities: int, q: int, dependent: bool
) -> tuple[int, float]:
    """Largest step that keeps the multipliers of inequalities ≥ 0, and the one that blocks it."""
    largest = 0.0
    for k in range(q):
        largest = max(largest, abs(r[k]))
    threshold = (1e3 * BLOCKS if dependent else BLOCKS) * largest
    blocking, t = -1, np.inf
    for k in range(equalities, q):
        if r[k] > threshold and mult[k] < t * r[k]:
            blocking, t = k, mult[k] / r[k]
    return blocking, t


@compiled
def solve_dual(
    H: np.ndarray,
    g: np.ndarray,
    C: np.ndarray,
    l: np.ndarray,  # noqa: E741
    u: np.ndarray,
    x: np.ndarray,
    lam: np.ndarray,
    scratch: np.ndarray,
    iscratch: np.ndarray,
    max_iter: int,
    warm: bool = False,
) -> int:
    """Minimises ½ xᵀHx + gᵀx subject to l ≤ Cx ≤ u; returns the status.

    H (n, n) symmetric positive definite, g (n,), C (m, n); l, u (m,) may be ∓inf, l == u means
    equality. All C-contiguous float64; none is modified. Rows of zeros are allowed.
    Out: x (n,); lam (m,) with Hx + g + Cᵀlam = 0, lam > 0 at an upper and < 0 at a lower bound;
    iscratch[0] iterations, iscratch[1] the number of active rows, iscratch[2:2 + active] their
    indices. x and lam are a solution only if the status is 0.
    scratch float64 (scratch_size(n, m),) and iscratch int64 (iscratch_size(n, m),) need no initial
    value and carry nothing from call to call, unless `warm`: then the method starts from the rows
    that the last call has left active in iscratch[1:] (iscratch[1] = 0 forgets them). x is the
    same up to rounding, and lam too where the active rows are independent; for a problem like the
    last one few iterations are left.

    Status: 0 solved; 1 infeasible; 2 iteration limit, or too ill-conditioned; 3 H not positive
    definite, or NaN or infinity where a finite number is needed.
    """
    m, n = C.shape
    p, pm = padded(n), padded(m)
    scratch = scratch[-(scratch.ctypes.data // 8) % ALIGNMENT :]
    matrix, vector = n * p, 2 * n * p + n * pm
    Jt = scratch[:matrix].reshape(n, p)
    Rt = scratch[matrix : 2 * matrix].reshape(n, p)
    Ct = scratch[2 * matrix : vector].reshape(n, pm)
    d = scratch[vector : vector + p]
    z = scratch[vector + p : vector + 2 * p]
    r = scratch[vector + 2 * p : vector + 3 * p]
    normal = scratch[vector + 3 * p : vector + 4 * p]  # signed, scaled, of the row being added
    mult = scratch[vector + 4 * p : vector + 5 * p]  # of the active rows, ≥ 0 for inequalities
    bound = scratch[vector + 5 * p : vector + 6 * p]  # signed, scaled, of the active rows
    vector += 6 * p
    s = scratch[vector : vector + pm]  # scaled Cx
    lower = scratch[vector + pm : vector + 2 * pm]  # scaled; ∓inf where the row must not be added
    upper = scratch[vector + 2 * pm : vector + 3 * pm]
    scale = scratch[vector + 3 * pm : vector + 4 * pm]
    work = scratch[vector + 4 * pm : vector + 5 * pm]
    active, sign = iscratch[2 : 2 + n], iscratch[2 + n : 2 + 2 * n]  # +1 at lower, −1 at upper
    last, last_sign = iscratch[2 + 2 * n : 2 + 3 * n], iscratch[2 + 3 * n : 2 + 4 * n]
    lasts = iscratch[1] if warm and 0 <= iscratch[1] <= n else 0  # rows to start from
    for k in range(lasts):
        last[k], last_sign[k] = active[k], sign[k]
    iscratch[0], iscratch[1] = 0, 0
    lam[:] = 0.0
    trace = factorise(H, Jt)
    if trace < 0.0:
        return INVALID
    status = scale_rows(C, l, u, Ct, scale, lower, upper)
    if status != SOLVED:
        return status

    # the unconstrained minimum, x = −JJᵀg
    for j in range(p):
        normal[j] = g[j] if j < n else 0.0
    split(Jt, 0, normal, d, z)
    for j in range(n):
        x[j] = -z[j]
    start = _size(x, 0.0)
    if not start < np.inf:
        return INVALID
    s[:] = 0.0
    advance_slacks(Ct, x, 1.0, s, work)

    q, equalities = np.int64(0), np.int64(0)  # a literal 0 would compile what it is handed to twice
    next_row, checks, skipped = 0, 0, False
    while True:
        # Choose a row: the equalities in their order, then the most violated.
        row, violation = -1, 0.0
        while row < 0 and next_row < m:
            if l[next_row] == u[next_row] and scale[next_row] > 0.0:
                row = next_row
            next_row += 1
        equality = row >= 0
        if not equality:
            if lasts > 0:
                q = resume(
                    Jt, Rt, Ct, q, equalities, last[:lasts], last_sign, active, sign, bound, mult,
                    lower, upper, x, trace, d, z, r, normal, s, work,
                )  # fmt: skip
                iscratch[1], lasts = q, 0
            accepted = FEASIBLE * _size(x, start) + ROUNDING * start
            row, violation = most_violated(s, lower, upper, work)
            if violation <= accepted:
                # Finished, up to rounding. Correct x and look again, with the sharper tolerance.
                _correct(Jt, Rt, Ct, q, active, sign, bound, x, start, r, z, s, work)
                if skipped:  # rows that followed from rows since dropped
                    for i in range(m):
                        low, high = l[i] * scale[i], u[i] * scale[i]
                        if max(low - s[i], s[i] - high) > CONSISTENT * _size(x, start):
                            lower[i], upper[i] = low, high
                row, violation = most_violated(s, lower, upper, work)
                if violation <= FEASIBLE * _size(x, start):
                    break
                checks += 1
                if checks == CHECKS:
                    return ITERATION_LIMIT
        side = 1.0 if lower[row] > s[row] else -1.0
        row_bound = lower[row] if side > 0.0 else -upper[row]
        for j in range(n):
            normal[j] = side * scale[row] * C[row, j]

        row_mult = 0.0
        while True:
            if iscratch[0] >= max_iter:
                return ITERATION_LIMIT
            iscratch[0] += 1
            free, square = split(Jt, q, normal, d, z)
            solve_upper(Rt, q, d, r)
            dependent = q == n or free <= max(DEPENDENT * square, 1e-28 * trace)
            blocking, t = _step_length(r, mult, equalities, q, dependent)
            violation = max(row_bound - side * s[row], 0.0)
            if dependent:
                if blocking < 0:
                    _correct(Jt, Rt, Ct, q, active, sign, bound, x, start, r, z, s, work)
                    violation = row_bound - side * s[row]
                    if violation > CONSISTENT * max(_size(x, start), abs(row_bound)):
                        return INFEASIBLE
                    lower[row], upper[row] = -np.inf, np.inf
                    skipped = True
                    break
            else:
                if violation <= t * free:
                    blocking, t = -1, violation / free
                for j in range(n):
                    x[j] += t * z[j]
                advance_slacks(Ct, z, t, s, work)
            for k in range(q):
                mult[k] -= t * r[k]
            row_mult += t
            if blocking < 0:
                append(Jt, Rt, q, d, z, free)
                active[q] = row
                sign[q] = 1 if side > 0.0 else -1
                bound[q] = row_bound
                mult[q] = row_mult
                lower[row], upper[row] = -np.inf, np.inf
                q += 1
                equalities += equality
                iscratch[1] = q
                break
            dropped = active[blocking]
            lower[dropped], upper[dropped] = (
                l[dropped] * scale[dropped],
                u[dropped] * scale[dropped],
            )
            remove(Jt, Rt, q, blocking)
            q -= 1
            for k in range(blocking, q):
                active[k], sign[k] = active[k + 1], sign[k + 1]
                bound[k], mult[k] = bound[k + 1], mult[k + 1]
            iscratch[1] = q

    # One refinement with the true gradient: x in the free directions, multipliers from the others.
    for i in range(n):
        gradient = g[i]
        for j in range(n):
            gradient += H[i, j] * x[j]
        normal[i] = gradient
    split(Jt, q, normal, d, z)
    solve_upper(Rt, q, d, mult)
    for j in range(n):
        x[j] -= z[j]
    for k in range(q):
        value = mult[k] if k < equalities else max(mult[k], 0.0)
        lam[active[k]] = -sign[k] * value * scale[active[k]]
    return SOLVED
