"""The factors of the dual active-set method [Goldfarb83], compiled, updated in place.

H is the Hessian, N the signed normals of the q active rows. The factors satisfy

    JᵀHJ = I,   JᵀN = [R; 0]

with J = [J₁ J₂] split after column q. Jt = Jᵀ (n, p) and Rt = Rᵀ (n, p) are stored by rows, padded
with zeros to p, a multiple of 8: every inner loop has unit stride and no remainder.
"""

import numpy as np

from poise.envs.compiled.jit import compiled

SMALLEST_PIVOT = 1e-14  # of H, relative to its diagonal entry


@compiled
def padded(k: int) -> int:
    """The next multiple of 8."""
    return (k + 7) // 8 * 8


@compiled
def factorise(H: np.ndarray, Jt: np.ndarray) -> float:
    """Jt ← L⁻¹ with H = LLᵀ; returns trace(H⁻¹) = ‖J‖², or −1 if H is not positive definite.

    Eliminates [H | I] in place: up to step k the first k columns of a row hold the inverse, the
    others what is left of H. Two pivots at a time, for half the stores.
    """
    n, p = Jt.shape
    for i in range(n):
        for j in range(n):
            Jt[i, j] = H[i, j]
        for j in range(n, p):
            Jt[i, j] = 0.0
    for k in range(0, n, 2):
        pivot0 = Jt[k, k]
        if not (pivot0 > SMALLEST_PIVOT * H[k, k] and pivot0 < np.inf):
            return -1.0
        inverse0 = 1.0 / pivot0
        Jt[k, k] = 1.0
        if k + 1 < n:
            corner = Jt[k, k + 1]
            factor0 = Jt[k + 1, k] * inverse0
            Jt[k + 1, k] = 0.0
            for j in range(p):
                Jt[k + 1, j] -= factor0 * Jt[k, j]
            pivot1 = Jt[k + 1, k + 1]
            if not (pivot1 > SMALLEST_PIVOT * H[k + 1, k + 1] and pivot1 < np.inf):
                return -1.0
            inverse1 = 1.0 / pivot1
            Jt[k + 1, k + 1] = 1.0
            for i in range(k + 2, n):
                factor0 = Jt[i, k] * inverse0
                factor1 = (Jt[i, k + 1] - factor0 * corner) * inverse1
                Jt[i, k] = 0.0
                for block in range(0, p, 8):
                    for j in range(block, block + 8):
                        Jt[i, j] -= factor0 * Jt[k, j] + factor1 * Jt[k + 1, j]
                Jt[i, k + 1] = -factor1
            _finish_row(Jt, k + 1, np.sqrt(inverse1))
        _finish_row(Jt, k, np.sqrt(inverse0))
    trace = 0.0
    for i in range(n):
        for j in range(p):
            trace += Jt[i, j] * Jt[i, j]
    return trace if trace < np.inf else -1.0


@compiled
def _finish_row(Jt: np.ndarray, k: int, scale: float):
    for j in range(k + 1):
        Jt[k, j] *= scale
    for j in range(k + 1, Jt.shape[0]):
        Jt[k, j] = 0.0


@compiled
def split(
    Jt: np.ndarray, q: int, normal: np.ndarray, d: np.ndarray, z: np.ndarray
) -> tuple[float, float]:
    """d = Jᵀn and z = J₂d₂; returns ‖d₂‖² (= nᵀz) and ‖d‖²."""
    n, p = Jt.shape
    active, free = 0.0, 0.0
    for j in range(p):
        z[j] = 0.0
    for i in range(n):
        value = 0.0
        for j in range(p):
            value += Jt[i, j] * normal[j]
        d[i] = value
        if i < q:
            active += value * value
        else:
            free += value * value
            for j in range(p):
                z[j] += value * Jt[i, j]
    return free, free + active


@compiled
def solve_upper(Rt: np.ndarray, q: int, d: np.ndarray, r: np.ndarray):
    """r = R⁻¹d₁."""
    for j in range(q):
        r[j] = d[j]
    for j in range(q - 1, -1, -1):
        value = r[j] / Rt[j, j]
        r[j] = value
        for i in range(j):
            r[i] -= value * Rt[j, i]


@compiled
def lift(Jt: np.ndarray, Rt: np.ndarray, q: int, e: np.ndarray, z: np.ndarray):
    """z = J₁R⁻ᵀe, the smallest step (in the metric of H) with Nᵀz = e; e is overwritten."""
    p = Jt.shape[1]
    for j in range(p):
        z[j] = 0.0
    for k in range(q):
        value = e[k]
        for i in range(k):
            value -= Rt[k, i] * e[i]
        e[k] = value / Rt[k, k]
        for j in range(p):
            z[j] += e[k] * Jt[k, j]


@compiled
def append(Jt: np.ndarray, Rt: np.ndarray, q: int, d: np.ndarray, z: np.ndarray, free: float):
    """Adds the row that gave d, z and free = ‖d₂‖²; d and z are overwritten.

    A reflection turns d₂ into (σ, 0, …); its product with J₂ᵀ is z − σ J₂e₁, so it costs one
    rank-one update.
    """
    n, p = Jt.shape
    sigma = -np.sqrt(free) if d[q] > 0.0 else np.sqrt(free)
    beta = 1.0 / (sigma * (sigma - d[q]))
    for j in range(p):
        z[j] -= sigma * Jt[q, j]
    for i in range(q):
        Rt[q, i] = d[i]
    Rt[q, q] = sigma
    d[q] -= sigma
    for i in range(q, n):
        factor = beta * d[i]
        for j in range(p):
            Jt[i, j] -= factor * z[j]


@compiled
def remove(Jt: np.ndarray, Rt: np.ndarray, q: int, k: int):
    """Deletes column k of R; rotations of neighbouring rows of Jᵀ make R triangular again."""
    p = Jt.shape[1]
    for j in range(k, q - 1):
        for i in range(j + 2):
            Rt[j, i] = Rt[j + 1, i]
    for j in range(k, q - 1):
        a, b = Rt[j, j], Rt[j, j + 1]
        length = np.sqrt(a * a + b * b)
        cosine, sine = a / length, b / length
        Rt[j, j] = length
        for col in range(j + 1, q - 1):
            a, b = Rt[col, j], Rt[col, j + 1]
            Rt[col, j] = cosine * a + sine * b
            Rt[col, j + 1] = cosine * b - sine * a
        for i in range(p):
            a, b = Jt[j, i], Jt[j + 1, i]
            Jt[j, i] = cosine * a + sine * b
            Jt[j + 1, i] = cosine * b - sine * a
