"""The updated factors against what defines them: JᵀHJ = I and JᵀN = [R; 0]."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.solvers.factors import (
    append,
    factorise,
    lift,
    padded,
    remove,
    solve_upper,
    split,
)
from tests.support.qp_problems import spd


def check(H, N, Jt, Rt):
    n, q = N.shape
    R = np.triu(Rt[:q, :q].T)
    np.testing.assert_allclose(Jt[:, :n] @ H @ Jt[:, :n].T, np.eye(n), atol=1e-10)
    np.testing.assert_allclose(Jt[:, :n] @ N, np.vstack([R, np.zeros((n - q, q))]), atol=1e-10)
    assert not Jt[:, n:].any()  # the padding stays zero


@pytest.mark.parametrize("n", [1, 2, 7, 8, 21])
def test_factors_follow_rows_that_come_and_go(n):
    """After every addition and removal of a row the factors are those of the remaining rows."""
    rng = np.random.default_rng(n)
    H = spd(rng, n, 1e3)
    Jt, Rt = np.full((n, padded(n)), np.nan), np.full((n, padded(n)), np.nan)
    assert factorise(H, Jt) == pytest.approx(np.trace(np.linalg.inv(H)))
    np.testing.assert_allclose(Jt[:, :n], np.linalg.inv(np.linalg.cholesky(H)), atol=1e-9)
    N = np.zeros((n, 0))
    d, z, r, normal = (np.zeros(padded(n)) for _ in range(4))
    for _ in range(6 * n):
        q = N.shape[1]
        if q < n and rng.random() < 0.7:
            normal[:n] = rng.normal(size=n)
            free, total = split(Jt, q, normal, d, z)
            assert total == pytest.approx(normal[:n] @ np.linalg.solve(H, normal[:n]))
            assert free == pytest.approx(normal[:n] @ z[:n])
            append(Jt, Rt, q, d, z, free)
            N = np.column_stack([N, normal[:n]])
        elif q:
            k = rng.integers(q)
            remove(Jt, Rt, q, k)
            N = np.delete(N, k, axis=1)
        check(H, N, Jt, Rt)

    q = N.shape[1]
    normal[:n] = rng.normal(size=n)
    split(Jt, q, normal, d, z)
    solve_upper(Rt, q, d, r)
    np.testing.assert_allclose(N.T @ z[:n], 0.0, atol=1e-8)  # the step leaves active rows alone
    np.testing.assert_allclose(H @ z[:n] + N @ r[:q], normal[:n], atol=1e-8)
    wanted = rng.normal(size=q)
    lift(Jt, Rt, q, wanted.copy(), z)
    np.testing.assert_allclose(N.T @ z[:n], wanted, atol=1e-8)


def test_not_positive_definite():
    """The factorisation refuses at the first pivot that is not positive."""
    for bad in ([[1.0, 2.0], [2.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]]):
        assert factorise(np.array(bad), np.zeros((2, 8))) == -1.0
