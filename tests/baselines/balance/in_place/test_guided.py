"""Pendulum models that guide the momentum QP: capture point, LQR, receding horizon."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import minimize_scalar

from poise.baselines.balance.in_place.capture_point import CapturePoint, CapturePointConfig
from poise.baselines.balance.in_place.lip_mpc import LIPMPC, LIPMPCConfig
from poise.baselines.balance.in_place.lqr_lip import LQRLIP, lqr_gain
from poise.baselines.controller import Targets
from poise.baselines.registry import load_controller
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.tasks.task import TaskSpace
from poise.envs.compiled.maths.pendulum import lip_step
from poise.envs.compiled.maths.polygons import half_planes
from poise.envs.physics.simulation import Simulation
from tests.support.refused import invalid
from tests.support.shared import robot


def moving(velocity, offset=(0.0, 0.0)):
    """A standing robot whose CoM is said to move, and its standing targets."""
    simulation = Simulation(robot())
    s = simulation.state_arrays
    targets = Targets.standing(robot(), simulation.state)
    s.com[:2] = targets.com[:2] + offset
    s.com_vel[:2] = velocity
    s.capture_point[:] = s.com[:2] + s.com_vel[:2] / s.omega
    return simulation.state, targets


def test_the_qp_is_asked_for_the_pendulums_acceleration():
    """Ṗ_des = m ω² (c − p) in the plane: its own CoM gains see no error."""
    controller = LQRLIP(robot())
    state, targets = moving([0.2, 0.1])
    controller.torques(state, targets)
    p = controller.cop(state, targets)
    ws = controller.qp.workspace
    rate = ws.desired[ws.part(TaskSpace.FORCE)][:2]
    expected = robot().mass * state.omega**2 * (state.com[:2] - p)
    np.testing.assert_allclose(rate, expected, rtol=1e-9)


def test_capture_point_law():
    """p = ξ + k (ξ − c_ref) inside; the nearest point of the polygon outside."""
    controller = CapturePoint(robot(), CapturePointConfig(gain=0.5))
    state, targets = moving([0.05, 0.02])
    xi = state.capture_point - targets.com[:2]
    np.testing.assert_allclose(controller.cop(state, targets) - targets.com[:2], 1.5 * xi)
    state, targets = moving([1.0, 0.0])
    p = controller.cop(state, targets)
    assert state.support_distance(p) == pytest.approx(0.0, abs=1e-9)
    assert p[0] - targets.com[0] > 0.1


def test_lqr_without_state_costs_mirrors_the_unstable_pole():
    """K → (2, 2)."""
    np.testing.assert_allclose(lqr_gain(0.0, 0.0), [2.0, 2.0], atol=1e-4)


def test_lqr_gain_is_optimal():
    """Other gains cost more from every start."""
    K, Q = lqr_gain(3.0, 0.5), np.diag([3.0, 0.5])

    def cost(gain, start):
        def rate(_, y):
            p = gain @ y[:2]
            return [y[1], y[0] - p, y[:2] @ Q @ y[:2] + p**2]

        return solve_ivp(rate, (0.0, 25.0), [*start, 0.0], rtol=1e-9, atol=1e-12).y[2, -1]

    for start in ([1.0, 0.0], [0.0, 1.0], [0.6, -1.0]):
        best = cost(K, start)
        for change in ([0.2, 0.0], [-0.2, 0.0], [0.0, 0.2], [0.0, -0.2]):
            assert cost(K + change, start) > best + 1e-6


def test_bellmans_equation_holds_of_the_gain():
    """With V = xᵀPx the cost to come of p = K x, min over p of xᵀQx + p² + V̇ is 0 in every state,
    and at p = K x: K = −BᵀP. The cost from a state to the end is V there."""
    A, B = np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([0.0, -1.0])
    Q, K = np.diag([3.0, 0.5]), lqr_gain(3.0, 0.5)
    closed = A + np.outer(B, K)
    P = solve_continuous_lyapunov(closed.T, -(Q + np.outer(K, K)))
    np.testing.assert_allclose(K, -B @ P, atol=1e-8)
    for x in np.random.default_rng(0).normal(size=(20, 2)):
        slope = 2.0 * P @ x

        def right(p, x=x, slope=slope):
            return x @ Q @ x + p * p + slope @ (A @ x + B * p)

        best = minimize_scalar(right, bracket=(-10.0, 10.0))
        assert best.fun == pytest.approx(0.0, abs=1e-7)
        assert best.x == pytest.approx(K @ x, abs=1e-5)


def test_the_pendulum_is_stepped_exactly():
    """Against an integrator."""
    A, B = lip_step(3.4, 0.07)
    start, p = np.array([0.03, 0.2 / 3.4]), 0.05
    end = solve_ivp(
        lambda _, y: [3.4 * y[1], 3.4 * (y[0] - p)], (0.0, 0.07), start, rtol=1e-11, atol=1e-13
    ).y[:, -1]
    np.testing.assert_allclose(A @ start + B * p, end, rtol=1e-8)


def test_half_planes():
    """Inside where all rows hold; corners lie on two of them."""
    polygon = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    N, b = half_planes(polygon)
    assert np.all(N @ [1.0, 0.5] < b) and np.any(N @ [2.1, 0.5] > b)
    for corner in polygon:
        assert np.sum(np.abs(N @ corner - b) < 1e-12) == 2


@pytest.mark.parametrize("velocity", [[0.1, -0.05], [0.45, 0.1], [-0.4, 0.3]])
def test_the_plan_is_feasible_and_optimal(velocity):
    """Every CoP lies in the polygon, and no nearby feasible plan costs less."""
    c = LIPMPCConfig()
    controller = LIPMPC(robot(), c)
    state, targets = moving(velocity)
    plan = controller.plan(state, targets)
    N, b = half_planes(state.support_polygon)
    assert np.all(plan @ N.T <= b + 1e-3)

    def cost(p):
        x, total = np.stack([state.com[:2] - targets.com[:2], state.com_vel[:2]]), 0.0
        x[1] /= controller.omega
        p = p - targets.com[:2]
        for k in range(c.steps):
            x = controller.A @ x + np.outer(controller.B, p[k])
            xi = x[0] + x[1]
            total += (c.capture_point + c.end * (k == c.steps - 1)) * xi @ xi + p[k] @ p[k]
            if k:
                total += c.change * np.sum((p[k] - p[k - 1]) ** 2)
        return total

    rng, best = np.random.default_rng(0), cost(plan)
    tried = 0
    for _ in range(300):
        other = plan + 0.01 * rng.normal(size=plan.shape) * (rng.random(plan.shape) < 0.3)
        if np.all(other @ N.T <= b):
            tried += 1
            assert cost(other) > best * (1.0 - 2e-3)
    if np.all(plan @ N.T <= b - 0.01):
        assert tried > 20


def test_the_horizon_knows_the_soles_and_lqr_does_not():
    """After a hard push LQR asks for a CoP in front of the toes, the plan for one at the toes."""
    state, targets = moving([0.4, 0.0])
    assert state.support_distance(LQRLIP(robot()).cop(state, targets)) < -0.02
    assert state.support_distance(LIPMPC(robot()).cop(state, targets)) > -1e-3


def test_a_reset_forgets():
    """The same trial twice gives the same plan, bit for bit."""
    controller = LIPMPC(robot(), LIPMPCConfig(qp=MomentumQPConfig()))
    plans = []
    for _ in range(2):
        controller.reset()
        for velocity in ([0.4, 0.1], [0.2, -0.1]):
            state, targets = moving(velocity)
            plans.append(controller.plan(state, targets))
    np.testing.assert_array_equal(plans[0], plans[2])
    np.testing.assert_array_equal(plans[1], plans[3])


def test_a_pendulum_needs_the_com_task_whose_gains_it_takes_out():
    with invalid("qp.com", "'com'"):
        load_controller({"base": "lqr-lip", "qp": {"base": "momentum-qp", "com": None}}, robot())
