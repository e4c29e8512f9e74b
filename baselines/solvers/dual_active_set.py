"""Goldfarb–Idnani dual active-set method [Goldfarb83], compiled, without allocation.

    min ½ xᵀHx + gᵀx   s.t.   l ≤ Cx ≤ u

The method starts at the unconstrained minimum and adds violated rows one at a time, so that every
iterate is optimal for the rows it holds. With N the (signed) normals of the active rows it keeps

    JᵀHJ = I,   JᵀN = [R; 0]

so the step direction of x is z = J₂J₂ᵀn and that of the multipliers r = R⁻¹J₁ᵀn. Both Jᵀ and Rᵀ
are stored by rows, padded to a multiple of 8 with zeros: every inner loop has unit stride.
Rows of C are scaled to unit norm, so that one tolerance serves rows of any unit.
"""

import numpy as np
from numba import njit

SOLVED, INFEASIBLE, ITERATION_LIMIT, INVALID = 0, 1, 2, 3

# NaN and infinity keep their meaning: no "nnan", no "ninf".
_COMPILE = dict(
    nogil=True,
    cache=True,
    error_model="numpy",
    fastmath={"contract", "reassoc", "nsz", "arcp"},
)

_PIVOT = 1e-14  # smallest pivot of H, relative to its diagonal entry
_FEASIBLE = 1e-11  # accepted row violation, relative to ‖x‖
_NOISE = 1e-13  # accepted row violation, relative to ‖x‖ at the unconstrained minimum
_CONSISTENT = 1e-9  # accepted violation of a row that depends on the active rows, relative to ‖x‖
_DEPENDENT = 1e-20  # squared sine below which a row depends on the active rows
_BLOCKS = 1e-13  # smallest multiplier direction that can block a step, relative to the largest
_CHECKS = 4  # how often a finished solution may be found wanting and taken up again


@njit(**_COMPILE)
def _padded(k):
    return (k + 7) // 8 * 8


@njit(**_COMPILE)
def scratch_size(n, m):
    """Number of float64 that `solve_dual` needs for n variables and m rows."""
    N, M = _padded(n), _padded(m)
    return 2 * n * N + N * M + 8 * N + 6 * M


@njit(**_COMPILE)
def iscratch_size(n, m):
    """Number of int64 that `solve_dual` needs for n variables and m rows."""
    return 2 + 2 * n


@njit(**_COMPILE)
def _factor(H, Jt):
    """Jᵀ = L⁻¹ with H = LLᵀ, by eliminating [H | I] in place; returns ‖J‖², or −1 if H is not PD.

    At step k the first k columns of a row hold the inverse and the others what is left of H.
    """
    n, N = Jt.shape[0], Jt.shape[1]
    for i in range(n):
        for j in range(n):
            Jt[i, j] = H[i, j]
        for j in range(n, N):
            Jt[i, j] = 0.0
    for k in range(n):
        pivot = Jt[k, k]
        if not (pivot > _PIVOT * H[k, k] and pivot < np.inf):
            return -1.0
        inverse = 1.0 / pivot
        Jt[k, k] = 1.0
        for i in range(k + 1, n):
            factor = Jt[i, k] * inverse
            Jt[i, k] = 0.0
            for j in range(N):
                Jt[i, j] -= factor * Jt[k, j]
        scale = np.sqrt(inverse)
        for j in range(k + 1):
            Jt[k, j] *= scale
        for j in range(k + 1, n):
            Jt[k, j] = 0.0
    total = 0.0
    for i in range(n):
        for j in range(N):
            total += Jt[i, j] * Jt[i, j]
    return total if total < np.inf else -1.0


@njit(**_COMPILE)
def _scale_rows(C, l, u, Ct, row_scale, lower, upper):
    """Ct = (C / row norms)ᵀ with scaled bounds; returns SOLVED, INFEASIBLE or INVALID."""
    m, n = C.shape
    M = Ct.shape[1]
    for i in range(m):
        for j in range(n):
            Ct[j, i] = C[i, j]
    for i in range(M):
        row_scale[i] = 0.0
    for j in range(n):
        for i in range(m, M):
            Ct[j, i] = 0.0
        for i in range(M):
            row_scale[i] += Ct[j, i] * Ct[j, i]
    status = SOLVED
    for i in range(m):
        square = row_scale[i]
        if not square < np.inf or np.isnan(l[i]) or np.isnan(u[i]):
            return INVALID
        norm = np.sqrt(square)
        scale = 1.0 / norm if norm > 0.0 else 0.0
        row_scale[i] = scale
        if l[i] > u[i] or l[i] == np.inf or u[i] == -np.inf:
            status = INFEASIBLE
        if scale > 0.0:
            lower[i] = l[i] * scale
            upper[i] = u[i] * scale
        else:  # 0ᵀx is 0, whatever x
            if l[i] > 0.0 or u[i] < 0.0:
                status = INFEASIBLE
            lower[i] = -np.inf
            upper[i] = np.inf
    for i in range(m, M):
        row_scale[i] = 0.0
        lower[i] = -np.inf
        upper[i] = np.inf
    for j in range(n):
        for i in range(M):
            Ct[j, i] *= row_scale[i]
    return status


@njit(**_COMPILE)
def _advance(Ct, z, t, s, product):
    """s += t Cz."""
    n, M = Ct.shape
    for i in range(M):
        product[i] = 0.0
    for j in range(n):
        factor = t * z[j]
        for i in range(M):
            product[i] += factor * Ct[j, i]
    for i in range(M):
        s[i] += product[i]


@njit(**_COMPILE)
def _most_violated(s, lower, upper, violation):
    """Index and violation of the most violated row (−1, 0 if none)."""
    M = s.shape[0]
    for i in range(M):
        below = lower[i] - s[i]
        above = s[i] - upper[i]
        violation[i] = below if below > above else above
    row, worst = -1, 0.0
    for i in range(M):
        if violation[i] > worst:
            row, worst = i, violation[i]
    return row, worst


@njit(**_COMPILE)
def _directions(Jt, Rt, q, normal, d, z, r):
    """d = Jᵀn, z = J₂d₂ and r = R⁻¹d₁; returns ‖d₂‖² (= nᵀz) and ‖d‖²."""
    n, N = Jt.shape
    active_square, free_square = 0.0, 0.0
    for j in range(N):
        z[j] = 0.0
    for i in range(n):
        value = 0.0
        for j in range(N):
            value += Jt[i, j] * normal[j]
        d[i] = value
        if i < q:
            active_square += value * value
            r[i] = value
        else:
            free_square += value * value
            for j in range(N):
                z[j] += value * Jt[i, j]
    _solve_upper(Rt, q, r)
    return free_square, free_square + active_square


@njit(**_COMPILE)
def _solve_upper(Rt, q, r):
    """r ← R⁻¹r."""
    for j in range(q - 1, -1, -1):
        value = r[j] / Rt[j, j]
        r[j] = value
        for i in range(j):
            r[i] -= value * Rt[j, i]


@njit(**_COMPILE)
def _solve_lower(Rt, q, r):
    """r ← R⁻ᵀr."""
    for j in range(q):
        value = r[j]
        for i in range(j):
            value -= Rt[j, i] * r[i]
        r[j] = value / Rt[j, j]


@njit(**_COMPILE)
def _append(Jt, Rt, q, d, z, free_square):
    """Adds a row: a reflection turns d₂ into (σ, 0, …). z = J₂d₂ gives its product with J₂ free."""
    n, N = Jt.shape
    sigma = -np.sqrt(free_square) if d[q] > 0.0 else np.sqrt(free_square)
    beta = 1.0 / (sigma * (sigma - d[q]))
    for j in range(N):
        z[j] -= sigma * Jt[q, j]
    for i in range(q):
        Rt[q, i] = d[i]
    Rt[q, q] = sigma
    d[q] -= sigma
    for i in range(q, n):
        factor = beta * d[i]
        for j in range(N):
            Jt[i, j] -= factor * z[j]


@njit(**_COMPILE)
def _remove(Jt, Rt, q, k):
    """Deletes column k of R; rotations of neighbouring rows of Jᵀ make R triangular again."""
    N = Jt.shape[1]
    for j in range(k, q - 1):
        for i in range(j + 2):
            Rt[j, i] = Rt[j + 1, i]
    for j in range(k, q - 1):
        a, b = Rt[j, j], Rt[j, j + 1]
        if b == 0.0:
            continue
        h = np.hypot(a, b)
        c, s = a / h, b / h
        Rt[j, j] = h
        for col in range(j + 1, q - 1):
            a, b = Rt[col, j], Rt[col, j + 1]
            Rt[col, j] = c * a + s * b
            Rt[col, j + 1] = c * b - s * a
        for i in range(N):
            a, b = Jt[j, i], Jt[j + 1, i]
            Jt[j, i] = c * a + s * b
            Jt[j + 1, i] = c * b - s * a


@njit(**_COMPILE)
def _norm(x, n):
    total = 0.0
    for j in range(n):
        total += x[j] * x[j]
    return np.sqrt(total)


@njit(**_COMPILE)
def solve_dual(H, g, C, l, u, x, lam, scratch, iscratch, max_iter):
    """Minimises ½ xᵀHx + gᵀx subject to l ≤ Cx ≤ u; returns the status.

    H (n, n) symmetric positive definite, g (n,), C (m, n), l and u (m,) may be ±inf, l == u means
    equality; all C-contiguous, none is modified (but callers should not rely on that for H).
    Out: x (n,); lam (m,) with Hx + g + Cᵀlam = 0, lam > 0 at an upper and < 0 at a lower bound;
    iscratch[0] the number of iterations, iscratch[1] the number of active rows,
    iscratch[2:2 + active] their indices.
    scratch (scratch_size(n, m),) float64 and iscratch (iscratch_size(n, m),) int64 need no
    initial value. Only with status 0 are x and lam a solution.

    Status: 0 solved, 1 infeasible, 2 iteration limit, 3 H not positive definite or NaN input.
    """
    m, n = C.shape
    N, M = _padded(n), _padded(m)
    a = 0
    Jt = scratch[a : a + n * N].reshape(n, N)
    a += n * N
    Rt = scratch[a : a + n * N].reshape(n, N)
    a += n * N
    Ct = scratch[a : a + n * M].reshape(n, M)
    a += n * M
    d = scratch[a : a + N]
    z = scratch[a + N : a + 2 * N]
    r = scratch[a + 2 * N : a + 3 * N]
    normal = scratch[a + 3 * N : a + 4 * N]
    mult = scratch[a + 4 * N : a + 5 * N]  # multipliers of the active rows, ≥ 0 for inequalities
    bound = scratch[a + 5 * N : a + 6 * N]  # signed bounds of the active rows
    a += 8 * N
    s = scratch[a : a + M]  # Cx
    lower = scratch[a + M : a + 2 * M]  # of the rows that may still be added, else ∓inf
    upper = scratch[a + 2 * M : a + 3 * M]
    row_scale = scratch[a + 3 * M : a + 4 * M]
    work = scratch[a + 4 * M : a + 5 * M]
    active = iscratch[2 : 2 + n]
    sign = iscratch[2 + n : 2 + 2 * n]  # +1 lower bound, −1 upper bound

    iscratch[0] = 0
    iscratch[1] = 0
    for i in range(m):
        lam[i] = 0.0
    for j in range(n):
        x[j] = np.nan
    J_square = _factor(H, Jt)
    if J_square < 0.0:
        return INVALID
    status = _scale_rows(C, l, u, Ct, row_scale, lower, upper)
    if status != SOLVED:
        return status

    for j in range(n):
        x[j] = 0.0
    for i in range(n):  # x = −JJᵀg
        value = 0.0
        for j in range(n):
            value += Jt[i, j] * g[j]
        for j in range(n):
            x[j] -= value * Jt[i, j]
    start_norm = _norm(x, n)
    if not start_norm < np.inf:
        return INVALID
    for j in range(N):
        normal[j] = 0.0
        z[j] = 0.0
    for i in range(M):
        s[i] = 0.0
    _advance(Ct, x, 1.0, s, work)

    iterations, q, equalities, next_equality, checks = 0, 0, 0, 0, 0
    while True:
        # choose the row to add: equalities in order, then the most violated
        row = -1
        while next_equality < m:
            i = next_equality
            next_equality += 1
            if l[i] == u[i] and lower[i] > -np.inf:
                row = i
                break
        equality = row >= 0
        if equality:
            below = lower[row] > s[row]
            violation = abs(lower[row] - s[row])
        else:
            row, violation = _most_violated(s, lower, upper, work)
            tolerance = _FEASIBLE * _norm(x, n) + _NOISE * start_norm
            if row < 0 or violation <= tolerance:
                # Finished, up to rounding: correct x on the active rows, then look again.
                checks += 1
                break_out = True
                for i in range(m):
                    s[i] = 0.0
                _advance(Ct, x, 1.0, s, work)
                worst = 0.0
                for k in range(q):
                    r[k] = bound[k] - sign[k] * s[active[k]]
                    worst = max(worst, abs(r[k]))
                if worst > 0.01 * tolerance:
                    _solve_lower(Rt, q, r)
                    for j in range(N):
                        z[j] = 0.0
                    for k in range(q):
                        for j in range(N):
                            z[j] += r[k] * Jt[k, j]
                    for j in range(n):
                        x[j] += z[j]
                    _advance(Ct, z, 1.0, s, work)
                    row, violation = _most_violated(s, lower, upper, work)
                    if row >= 0 and violation > tolerance and checks < _CHECKS:
                        break_out = False
                if break_out:
                    break
            below = lower[row] > s[row]
        side = 1.0 if below else -1.0
        p_bound = side * lower[row] if below else side * upper[row]
        for j in range(n):
            normal[j] = side * row_scale[row] * C[row, j]

        p_mult = 0.0
        while True:
            if iterations >= max_iter:
                iscratch[0] = iterations
                iscratch[1] = q
                return ITERATION_LIMIT
            iterations += 1
            free_square, square = _directions(Jt, Rt, q, normal, d, z, r)
            dependent = q == n or free_square <= max(_DEPENDENT * square, 1e-28 * J_square)
            largest = 0.0
            for k in range(q):
                largest = max(largest, abs(r[k]))
            threshold = (1e-10 if dependent else _BLOCKS) * largest
            blocking, t = -1, np.inf
            for k in range(equalities, q):
                if r[k] > threshold and mult[k] < t * r[k]:
                    t = mult[k] / r[k]
                    blocking = k
            if dependent:
                if blocking < 0 or equality:
                    if violation <= _CONSISTENT * max(_norm(x, n), abs(p_bound)):
                        lower[row] = -np.inf  # the row follows from the others
                        upper[row] = np.inf
                        break
                    iscratch[0] = iterations
                    iscratch[1] = q
                    return INFEASIBLE
            else:
                full = violation / free_square
                if full <= t:
                    t = full
                    blocking = -1
            for k in range(q):
                mult[k] -= t * r[k]
            p_mult += t
            if not dependent:
                for j in range(n):
                    x[j] += t * z[j]
                _advance(Ct, z, t, s, work)
            if blocking < 0:
                _append(Jt, Rt, q, d, z, free_square)
                active[q] = row
                sign[q] = 1 if side > 0.0 else -1
                bound[q] = p_bound
                mult[q] = p_mult
                lower[row] = -np.inf
                upper[row] = np.inf
                q += 1
                if equality:
                    equalities += 1
                break
            violation = p_bound - side * s[row]
            dropped = active[blocking]
            lower[dropped] = l[dropped] * row_scale[dropped]
            upper[dropped] = u[dropped] * row_scale[dropped]
            _remove(Jt, Rt, q, blocking)
            for k in range(blocking, q - 1):
                active[k] = active[k + 1]
                sign[k] = sign[k + 1]
                bound[k] = bound[k + 1]
                mult[k] = mult[k + 1]
            q -= 1

    # One refinement with the true gradient: multipliers from J₁, and x in the free directions.
    for i in range(n):
        value = g[i]
        for j in range(n):
            value += H[i, j] * x[j]
        normal[i] = value
    _directions(Jt, Rt, q, normal, d, z, mult)
    for j in range(n):
        x[j] -= z[j]
    for k in range(q):
        value = mult[k] if k < equalities else max(mult[k], 0.0)
        lam[active[k]] = -sign[k] * value * row_scale[active[k]]
    iscratch[0] = iterations
    iscratch[1] = q
    return SOLVED
