"""The eliminated problem: every x obeys physics, and the solution obeys every limit."""

import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.solvers import make_solver, residuals
from poise.baselines.whole_body.constraints import braking_bounds
from poise.baselines.whole_body.tasks.task import task_input
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, random_state, recovery, robot_named


@pytest.fixture(scope="module")
def robot():
    return robot_named("humanoid")


def solved(root="hard"):
    return [tick for tick in recovery(root=root) if tick.solved]


def null_space(ws):
    """(nz, nv) rows that span the null space of J."""
    return ws.V[:, : ws.first_internal].T


@pytest.mark.parametrize("root", ["hard", "soft"])
def test_every_x_obeys_the_dynamics_and_leaves_the_soles(robot, root):
    """For any x at all, J v̇ is what the soles need and M v̇ + h = Sᵀτ + Jᵀw + u_root."""
    qp = controller(robot, root=root)
    rng = np.random.default_rng(0)
    for tick in solved(root)[::10]:
        state, ws = tick.state, qp.workspace
        n = len(qp.problem(state, tick.targets).g)
        assert n == robot.model.nv - 12 + 6 + (6 if root == "soft" else 0)
        x = 10.0 * rng.normal(size=n)
        vdot = ws.vdot0 + null_space(ws).T @ x[: ws.first_internal]
        needed = -qp.parameters.sole_damping * state.J_v - state.Jdot_v
        np.testing.assert_allclose(state.J @ vdot, needed, atol=1e-8 * np.abs(vdot).max())
        force = state.M @ vdot + state.h - state.J.T @ (ws.w0 + ws.E @ x)
        np.testing.assert_allclose(force[6:], ws.tau0 + ws.T @ x, atol=1e-8)
        if root == "soft":  # u_root acts at the CoM
            arm, u = state.com - state.qpos[:3], x[-6:]
            moment = state.root_axes.T @ (u[3:] + np.cross(arm, u[:3]))
            force[:6] -= np.concatenate([u[:3], moment])
        np.testing.assert_allclose(force[:6], 0.0, atol=1e-8 * np.abs(x).max() * state.mass)


def test_null_space_is_orthonormal(robot):
    """N has orthonormal rows, so that x has the size of an acceleration; v̇₀ has no part in it."""
    qp = controller(robot)
    for tick in solved()[::10]:
        qp.problem(tick.state, tick.targets)
        ws = qp.workspace
        N = null_space(ws)
        np.testing.assert_allclose(N @ N.T, np.eye(len(N)), atol=1e-12)
        np.testing.assert_allclose(N @ ws.vdot0, 0.0, atol=1e-10 * np.abs(ws.vdot0).max())


@pytest.mark.parametrize("root", ["hard", "soft"])
def test_optimality_conditions(robot, root):
    """At the solution nothing is violated, the gradient vanishes and the duality gap is closed."""
    qp, solver = controller(robot, root=root), make_solver("active-set")
    for tick in solved(root)[::5]:
        problem = qp.problem(tick.state, tick.targets)
        left = residuals(problem, solver.solve(problem))
        scale = np.abs(problem.g).max()
        assert left.primal < 1e-8
        assert left.dual < 1e-9 * scale
        assert left.gap < 1e-8 * scale


def test_solution_is_physical(robot):
    """Friction and CoP of each sole, torques and the total wrench are what the ground can give."""
    limits, saturated = robot.torque_limit, 0
    for tick in solved():
        state = tick.state
        total = np.zeros(6)
        pairs = zip(tick.wrenches.reshape(-1, 6), state.sole_points, state.sole_axes, strict=True)
        for (wrench, point, axes), sole in zip(pairs, robot.soles, strict=True):
            force, moment = axes.T @ wrench[:3], axes.T @ wrench[3:]
            assert force[2] >= -1e-7
            assert np.hypot(force[0], force[1]) <= 0.8 * force[2] + 1e-6
            if force[2] > 1.0:
                cop = np.array([-moment[1], moment[0]]) / force[2]
                edges = np.roll(sole.polygon, -1, axis=0) - sole.polygon
                to_cop = cop - sole.polygon
                assert np.all(edges[:, 0] * to_cop[:, 1] - edges[:, 1] * to_cop[:, 0] > 0.0)
            arm = point - state.com
            total += np.concatenate([wrench[:3], wrench[3:] + np.cross(arm, wrench[:3])])
        expected = state.A @ tick.vdot + state.A_bias
        np.testing.assert_allclose(total, expected, atol=1e-6)
        assert np.all(np.abs(tick.torques) <= limits + 1e-9)
        saturated += np.any(np.abs(tick.torques) > limits - 1e-6)
    assert saturated > 5


def test_at_rest_the_ground_carries_the_weight(robot):
    """Standing at rest, Σ f_z = m g, nothing pulls sideways, and both feet carry the same."""
    qp, simulation = controller(robot), Simulation(robot)
    targets = Targets.standing(robot, simulation.state)
    for _ in range(400):
        simulation.step(qp.torques(simulation.state, targets), 2)
    w = qp.wrenches.reshape(-1, 6)
    weight = robot.mass * 9.81
    assert w[:, 2].sum() == pytest.approx(weight, rel=1e-3)
    np.testing.assert_allclose(w[:, :2].sum(axis=0), 0.0, atol=1e-3 * weight)
    assert w[0, 2] == pytest.approx(w[1, 2], rel=1e-4)
    np.testing.assert_allclose(qp.vdot, 0.0, atol=0.05)


def test_an_acceleration_that_nothing_hinders_is_reproduced(robot):
    """Targets that all ask for one feasible motion get it: v̇ is the desired one."""
    qp = controller(robot)
    qp.tasks["cop"].block.weight[:] = 0.0
    state = Simulation(robot).state
    targets = Targets.standing(robot, state)
    qp.problem(state, targets)  # for N
    rng = np.random.default_rng(1)
    N = null_space(qp.workspace)
    vdot = N.T @ (0.3 * rng.normal(size=len(N)))
    targets.a_ref[:] = vdot[6:]
    targets.root_acc[:] = vdot[3:6]
    targets.com_acc[:] = (state.A[:3] @ vdot) / state.mass
    targets.com[:] = state.com
    qp.torques(state, targets)
    assert np.abs(vdot).max() > 0.3
    np.testing.assert_allclose(qp.vdot, vdot, atol=2e-3)


def test_posture_error_is_a_rotation_at_any_angle():
    """The compiled desired accelerations are those of the readable rows, also upside down."""
    robot = robot_named("tall")
    qp, simulation = controller(robot), Simulation(robot)
    targets = Targets.standing(robot, simulation.state)
    rng = np.random.default_rng(5)
    targets.root_vel[:], targets.root_acc[:] = rng.normal(size=3), rng.normal(size=3)
    targets.v_ref[:] = rng.normal(size=len(targets.v_ref))
    for _ in range(20):
        state = simulation.reset(*random_state(robot, rng))
        qp.problem(state, targets)
        rows = qp.tasks["posture"].rows(task_input(state, targets))
        weighed = rows.weights > 0.0
        np.testing.assert_allclose(
            qp.workspace.accel_des[weighed], rows.b[weighed], rtol=1e-7, atol=1e-7
        )


def test_problem_is_pure(robot):
    """Looking at the problem changes neither the next problem nor the next torques."""
    tick, later = solved()[20:22]
    qp, other = controller(robot), controller(robot)
    first = qp.problem(tick.state, tick.targets)
    second = qp.problem(tick.state, tick.targets)
    for name in "HgClu":
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    np.testing.assert_array_equal(
        qp.torques(later.state, later.targets), other.torques(later.state, later.targets)
    )


@pytest.mark.parametrize("speed", [0.5, 3.0, 8.0])
def test_braking_stops_before_the_limit(speed):
    """A joint that accelerates as hard as it may towards its limit stops there, not beyond it."""
    accel, horizon, floor, dt = 40.0, 0.03, 200.0, 0.004
    q, v = -0.9, min(speed, np.sqrt(2 * accel * 0.9))
    for _ in range(1000):
        _, high = braking_bounds(q, v, -1.0, 0.0, accel, horizon, floor)
        assert high >= -floor
        v += dt * min(high, 50.0)
        q += dt * v
        assert q < 1e-4
    assert -1e-3 < q and abs(v) < 1e-3


def test_braking_bounds_far_from_limits_and_beyond_them():
    """Free joints are free; too fast a joint is asked for the floor at most; bounds never cross."""
    assert braking_bounds(0.0, 5.0, -np.inf, np.inf, 40.0, 0.03, 200.0) == (-np.inf, np.inf)
    assert braking_bounds(0.0, 50.0, -1.0, 0.0, 40.0, 0.03, 200.0)[1] == -200.0
    low, high = braking_bounds(0.3, 1.0, -1.0, 0.0, 40.0, 0.03, 200.0)  # beyond, going further
    assert high < 0.0 and low <= high
    assert braking_bounds(0.1, 0.0, -1.0, 0.0, 40.0, 0.03, 200.0)[1] < 0.0  # it is led back
    mirrored = braking_bounds(-0.3, -1.0, 0.0, 1.0, 40.0, 0.03, 200.0)
    assert mirrored == (-high, -low)
