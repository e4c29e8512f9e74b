"""Accelerations that keep the contacts where they are: the null space of J, compiled.

Only the joints between the root and a contact (the *held* ones) have columns in J. So the null
space is one orthonormal vector for each other joint, its own acceleration, and an orthonormal basis
of the held part, from Householder's QR of Jᵀ with column pivoting.

Two legs of fewer than six joints are a closed chain near a dead centre: soles that are turned by
1° hold a pelvis at full strength that is free where they are parallel. What a soft contact gives
way by is enough to move it. So there the row of J that the pivoting takes last, the weakest, is
left to a task of the objective, and the null space is that of the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled

WHOLE_LEG = 6  # joints that place a foot anywhere
DEPENDENT = 1e-6  # pivot, relative to the first, below which a row of J follows from the others


@dataclass(frozen=True, eq=False)
class NullSpace(Block):
    """Scratch for `solve_resting`: nh held degrees of freedom, k rows of J, padded to kp."""

    held: np.ndarray  # (nh,) int
    free: np.ndarray  # (nv − nh,) int
    rows: Annotated[np.ndarray, "nh", "kp"]  # Jᵀ on its way to R, its columns not swapped
    product: Annotated[np.ndarray, "width"]  # as wide as `rows` or `basis`: scratch
    reflectors: Annotated[np.ndarray, "steps", "nh"]
    beta: Annotated[np.ndarray, "steps"]
    pivot: Annotated[np.ndarray, "steps", np.int64]  # the row of J that each reflector eliminates
    open: Annotated[np.ndarray, "k", np.bool_]  # rows of J still to be eliminated
    spare: int  # 1 where the weakest row, the last of `pivot`, is no equality; else 0
    weakest: Annotated[np.ndarray, 2]  # R, r: that row of J v̇ = b is R x_0 = r, x_0 the first of x
    basis: Annotated[np.ndarray, "nh", "nb"]  # null vectors, then v̇₀, as columns


def allocate_null_space(
    nv: int, chains: Sequence[np.ndarray], points: Sequence[np.ndarray] = ()
) -> NullSpace:
    """Zeroed scratch for a robot of `nv` dofs: soles and points at the ends of chains of joints."""
    k = 6 * len(chains) + 3 * len(points)
    held = np.unique(np.concatenate([*chains, *points]))
    nh, steps, spare = len(held), min(k, len(held)), int(short_legs(chains))
    kp, nb = (-(-columns // 8) * 8 for columns in (k, nh - steps + spare + 1))
    sizes = {"nh": nh, "k": k, "kp": kp, "nb": nb, "width": max(kp, nb), "steps": steps}
    return NullSpace.allocate(sizes, held=held, free=np.setdiff1d(np.arange(nv), held), spare=spare)


def short_legs(chains: Sequence[np.ndarray]) -> bool:
    """Whether there are several legs, and one has fewer than six joints of its own."""
    sets = [set(chain) for chain in chains]
    others = [set().union(*sets[:i], *sets[i + 1 :]) for i in range(len(sets))]
    own = [len(chain - other) for chain, other in zip(sets, others, strict=True)]
    return len(own) > 1 and min(own) < WHOLE_LEG


@compiled
def solve_resting(
    J: np.ndarray, rhs: np.ndarray, space: NullSpace, vdot0: np.ndarray, V: np.ndarray
):
    """v̇ = v̇₀ + V z for any z solves J v̇ = rhs; v̇₀ is the least solution.

    In: J (k, nv), rhs (k,). Out: vdot0 (nv,), and in the first columns of V (nv, n) an orthonormal
    basis of the null space: the held joints' part, then one column for each other joint; the rest
    is zero. Rows of J that depend on others (a straight leg) are dropped: their part of v̇₀ is 0.
    With a `spare` row the first column moves that one alone, and v̇₀ solves the others.
    """
    held, free, basis = space.held, space.free, space.basis
    steps, nh = space.reflectors.shape
    equalities = steps - space.spare
    nullity = nh - equalities
    _reduce(J, space)
    basis[:, :] = 0.0
    smallest = DEPENDENT * abs(space.rows[0, space.pivot[0]])
    for r in range(steps):  # Rᵀ y = rhs
        column = space.pivot[r]
        total = rhs[column]
        for i in range(r):
            total -= space.rows[i, column] * basis[i, nullity]
        pivot = space.rows[r, column]
        if r == equalities:
            space.weakest[0], space.weakest[1] = pivot, total
            break
        basis[r, nullity] = total / pivot if abs(pivot) > smallest else 0.0
    for i in range(nullity):
        basis[equalities + i, i] = 1.0
    for r in range(steps - 1, -1, -1):
        _reflect(space.reflectors[r], space.beta[r], r, basis, space.product)
    V[:, :] = 0.0
    vdot0[:] = 0.0
    for i in range(nh):
        vdot0[held[i]] = basis[i, nullity]
        for j in range(nullity):
            V[held[i], j] = basis[i, j]
    for j in range(len(free)):
        V[free[j], nullity + j] = 1.0


@compiled
def _reduce(J: np.ndarray, space: NullSpace):
    """Householder's QR of Jᵀ: `reflectors`, `beta`, `pivot`, and R in `rows`.

    All columns are treated alike: those that are finished are zero where a reflector acts.
    """
    rows, norms = space.rows, space.product
    nh, columns = rows.shape
    k = J.shape[0]
    for i in range(nh):
        for c in range(k):
            rows[i, c] = J[c, space.held[i]]
    space.open[:] = True
    for r in range(space.reflectors.shape[0]):
        norms[:] = 0.0
        for i in range(r, nh):
            for c in range(columns):
                norms[c] += rows[i, c] * rows[i, c]
        best, norm2 = -1, -1.0
        for c in range(k):
            if space.open[c] and norms[c] > norm2 * (1.0 + 1e-9):
                best, norm2 = c, norms[c]
        space.open[best] = False
        space.pivot[r] = best
        v = space.reflectors[r]
        for i in range(v.shape[0]):
            v[i] = rows[i, best]
        alpha = -np.sqrt(norm2) if v[r] > 0.0 else np.sqrt(norm2)
        length2 = 2.0 * (norm2 - alpha * v[r])
        v[r] -= alpha
        space.beta[r] = 2.0 / length2 if length2 > 0.0 else 0.0
        _reflect(v, space.beta[r], r, rows, norms)
        rows[r, best] = alpha
        rows[r + 1 :, best] = 0.0


@compiled
def _reflect(v: np.ndarray, beta: float, start: int, columns: np.ndarray, product: np.ndarray):
    """columns ← (I − β v vᵀ) columns, for a v that counts from `start`; `product` is scratch."""
    width = columns.shape[1]
    for j in range(width):
        product[j] = 0.0
    for i in range(start, len(v)):
        for j in range(width):
            product[j] += v[i] * columns[i, j]
    for i in range(start, len(v)):
        factor = beta * v[i]
        for j in range(width):
            columns[i, j] -= factor * product[j]
