"""Pontryagin's principle [Notes, lecture 12]: costates of the optimum that the QP finds."""

import numpy as np
import pytest

from poise.baselines.balance.in_place.lqr_lip import lqr_gain
from poise.baselines.solvers import QP
from poise.baselines.solvers.dual_active_set import SOLVED
from tests.baselines.solvers.test_dual_active_set import run

STEPS, DT = 80, 0.05
A = np.eye(2) + DT * np.array([[0.0, 1.0], [1.0, 0.0]])  # the pendulum x'' = x − p, in steps
B = DT * np.array([0.0, -1.0])
Q = DT * np.diag([1.0, 0.5])
R = DT
START = np.array([0.05, 0.05])


def optimum(limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Controls (N,) and states (N + 1, 2) of least Σ xᵀQx/2 + R u²/2 with |u| ≤ limit, by one QP
    in the controls."""
    powers = [np.linalg.matrix_power(A, k) for k in range(STEPS + 1)]
    free = np.array([power @ START for power in powers])
    effect = np.zeros((STEPS + 1, 2, STEPS))
    for k in range(1, STEPS + 1):
        for j in range(k):
            effect[k, :, j] = powers[k - 1 - j] @ B
    H = R * np.eye(STEPS) + np.einsum("kai,ab,kbj->ij", effect, Q, effect)
    g = np.einsum("kai,ab,kb->i", effect, Q, free)
    bound = np.full(STEPS, limit)
    status, u, _, _, _ = run(QP(H, g, np.eye(STEPS), -bound, bound))
    assert status == SOLVED
    return u, free + effect @ u


@pytest.mark.parametrize("limit", [10.0, 0.12])
def test_the_control_minimises_the_hamiltonian(limit: float) -> None:
    """λ_N = Q x_N and λ_k = Q x_k + Aᵀ λ_{k+1} backwards; u_k is the least of
    R u²/2 + λ_{k+1}ᵀ B u within its limits, also where they bind."""
    u, x = optimum(limit)
    costate = Q @ x[-1]
    for k in reversed(range(STEPS)):
        least = np.clip(-(B @ costate) / R, -limit, limit)
        assert u[k] == pytest.approx(least, abs=1e-7)
        costate = Q @ x[k] + A.T @ costate
    assert (np.abs(u) >= limit - 1e-9).any() == (limit < 1.0)
    assert np.abs(x[-1]).max() < np.abs(START).max()


def test_open_loop_and_feedback_agree_where_nothing_binds() -> None:
    """The first control of the open loop is that of the feedback law, but for the steps' length."""
    u, _ = optimum(10.0)
    assert u[0] == pytest.approx(lqr_gain(1.0, 0.5) @ START, rel=0.12)
