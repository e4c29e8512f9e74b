"""The readable QP: its rows against the simulator, its solution against the compiled one."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from poise.baselines.constraint_rows import (
    Bounds,
    joint_limits,
    root_dynamics,
    sole_cones,
    sole_motion,
    torque_limits,
    torque_matrix,
)
from poise.baselines.controller import Targets
from poise.baselines.formulation import build, torques_of, unknowns
from poise.baselines.reduced_qp import braking_bounds
from poise.baselines.solvers import make_solver
from poise.baselines.task_rows import (
    Rows,
    angular_momentum_rows,
    desired_angular_rate,
    desired_cop,
    desired_linear_rate,
    linear_momentum_rows,
    posture_rows,
)
from poise.envs.simulation import Simulation

from .physics import (
    contact_forces,
    controller,
    forward,
    random_state,
    recovery,
    robot_named,
    wrench_about,
)


@pytest.fixture(scope="module")
def robot():
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def tick():
    """A state on the way back from a push, where limits bind."""
    return recovery()[30]


def solve(qp, name="daqp"):
    solution = make_solver(name).solve(qp)
    assert solution.solved
    return solution


def motors(state, torques):
    return torques[state.robot.motor_dofs - 6]


@pytest.mark.parametrize(
    ("name", "root"), [("humanoid", "hard"), ("humanoid", "soft"), ("tall", "hard")]
)
def test_the_compiled_problem_has_the_same_solution(name, root):
    """Torques, accelerations, wrenches and u_root agree along push recoveries: 1e-9 relative."""
    ticks = [tick for tick in recovery(name, root) if tick.solved]
    assert len(ticks) >= 50
    binding, leaning = 0, 0.0
    for tick in ticks:
        state = tick.state
        qp = build(state, tick.targets, tick.parameters, tick.cop_vel)
        solution = solve(qp)
        vdot, w, u_root = unknowns(state, solution.x)
        torques = motors(state, torques_of(state, solution.x))
        pairs = [(torques, tick.torques), (vdot, tick.vdot), (w, tick.wrenches)]
        if root == "soft":
            assert np.abs(u_root).max() > 1e-3
            pairs.append((u_root, tick.root_wrench))
        for ours, theirs in pairs:
            np.testing.assert_allclose(ours, theirs, atol=1e-9 * max(np.abs(theirs).max(), 1.0))
        binding += np.abs(solution.lam[qp.l < qp.u]).max() > 1e-6
        leaning = max(leaning, np.abs(u_root).max())
    assert binding >= 25  # in most of them something is at its limit
    assert (leaning > 0.1) == (root == "soft")  # [N]


def test_the_active_set_solver_agrees_on_the_readable_problem():
    """The full problem, with its equalities, is solved alike by two methods."""
    for tick in [tick for tick in recovery() if tick.solved][::8]:
        qp = build(tick.state, tick.targets, tick.parameters, tick.cop_vel)
        ours = torques_of(tick.state, solve(qp, "active-set").x)
        np.testing.assert_allclose(motors(tick.state, ours), tick.torques, atol=1e-7)


def test_the_accel_floor_of_the_compiled_problem_changes_little(robot):
    """What regularises the compiled problem alone changes torques by less than 1 % of their limits."""
    qp = controller(robot)
    for tick in [tick for tick in recovery() if tick.solved][::8]:
        qp.reset(tick.state)
        with_floor = qp.torques(tick.state, tick.targets)
        x = solve(build(tick.state, tick.targets, qp.parameters)).x
        change = with_floor - motors(tick.state, torques_of(tick.state, x))
        assert np.abs(change / robot.torque_limit).max() < 1e-2


@pytest.mark.parametrize("name", ["humanoid", "compact", "tall"])
def test_the_simulator_obeys_the_dynamics_rows(name):
    """MuJoCo's own accelerations and contact forces satisfy the root rows; τ is what was applied."""
    robot = robot_named(name)
    simulation = Simulation(robot)
    rng = np.random.default_rng(3)
    simulation.reset(robot.standing_qpos, 0.1 * rng.normal(size=robot.model.nv))
    torques = 0.2 * rng.uniform(-1, 1, robot.model.nu) * robot.torque_limit
    simulation.step(torques, 5)
    state = forward(simulation)
    wrenches = [
        wrench_about(point, contact_forces(simulation, sole.body_id))
        for point, sole in zip(state.sole_points, robot.soles, strict=True)
    ]
    x = np.concatenate([simulation.data.qacc, *wrenches])
    p = controller(robot).parameters
    rows = root_dynamics(state, p)
    scale = state.mass * 9.81
    np.testing.assert_allclose(rows.C @ x, rows.l, atol=1e-7 * scale)
    assert np.abs(state.h[:6]).max() > 0.5 * scale
    applied = simulation.data.qfrc_actuator + simulation.data.qfrc_constraint
    for wrench, i in zip(wrenches, range(len(wrenches)), strict=True):
        applied = applied - state.J[6 * i : 6 * i + 6].T @ wrench  # joint limits are left
    np.testing.assert_allclose(torques_of(state, x), applied[6:], atol=1e-6)


def test_a_soft_root_pushes_as_a_force_at_the_com(robot):
    """The columns of u_root are MuJoCo's generalised forces of a wrench about the CoM."""
    simulation = Simulation(robot)
    state = simulation.reset(*random_state(robot, np.random.default_rng(1)))
    p = controller(robot, root="soft").parameters
    C = root_dynamics(state, p).C
    wrench = np.random.default_rng(2).normal(size=6)
    out = np.zeros(robot.model.nv)
    mujoco.mj_applyFT(
        robot.model, simulation.data, wrench[:3], wrench[3:], state.com.copy(),
        robot.root_body_id, out,
    )  # fmt: skip
    np.testing.assert_allclose(-C[:, -6:] @ wrench, out[:6], atol=1e-12)


def test_posture_rows_vanish_on_the_reference_and_bring_back_to_it(robot):
    """On the reference v̇ = a_ref; beside it, one stiff step moves every joint and the root to it."""
    simulation = Simulation(robot)
    state = simulation.state
    targets = Targets.standing(robot, state)
    p = controller(robot).parameters
    targets.a_ref[:] = np.arange(len(targets.a_ref))
    rows = posture_rows(state, targets, p)
    np.testing.assert_allclose(rows.b[6:], targets.a_ref, atol=1e-9)
    np.testing.assert_allclose(rows.b[:6], 0.0, atol=1e-6)

    rng = np.random.default_rng(0)
    qpos = robot.standing_qpos.copy()
    mujoco.mj_integratePos(robot.model, qpos, 0.3 * rng.normal(size=robot.model.nv), 1.0)
    state = simulation.reset(qpos)
    targets.a_ref[:] = 0.0
    stiff = p._replace(stiffness=np.ones(robot.model.nv), damping=np.zeros(robot.model.nv))
    step = posture_rows(state, targets, stiff).b
    mujoco.mj_integratePos(robot.model, qpos, step, 1.0)
    state = simulation.reset(qpos)
    np.testing.assert_allclose(state.q, targets.q_ref, atol=1e-9)
    np.testing.assert_allclose(state.root_axes, targets.root_axes, atol=1e-6)


def test_desired_momentum_rates(tick):
    """Ṗ_des is a PD law on c; L̇_des has its moment from the force Ṗ_des − m g at p_des."""
    state, targets = tick.state, tick.targets
    p = tick.parameters._replace(
        com_stiffness=np.array([2.0, 3.0, 4.0]), com_damping=np.array([5.0, 6.0, 7.0]),
        cop_horizon=0.1, cop_stiffness=10.0, cop_damping=2.0, angular_damping=3.0,
    )  # fmt: skip
    moving = replace(targets, com_vel=np.array([0.1, 0.2, 0.3]), com_acc=np.array([1.0, 2.0, 3.0]))
    rate = desired_linear_rate(state, moving, p)
    for i in range(3):
        accel = (i + 1.0) + (i + 2.0) * (targets.com[i] - state.com[i])
        accel += (i + 5.0) * (0.1 * (i + 1) - state.com_vel[i])
        assert rate[i] == pytest.approx(state.mass * accel, rel=1e-12)
    cop_vel = np.array([0.3, -0.2])
    cop = desired_cop(state, moving, p, cop_vel)
    expected = state.cop + 0.1 * cop_vel
    expected += 0.005 * (-10.0 * (state.cop - targets.cop) - 2.0 * cop_vel)
    np.testing.assert_allclose(cop, [*expected, state.origin[2]], atol=1e-12)
    force = rate + [0.0, 0.0, state.mass * 9.81]
    moment = wrench_about(state.com, [(cop, force)])[3:] - 3.0 * state.angular_momentum
    np.testing.assert_allclose(desired_angular_rate(state, moving, p, cop_vel), moment, atol=1e-9)


def test_momentum_rows_are_met_by_the_motion_they_ask_for(tick):
    """Where v̇ gives Ṗ_des and L̇_des, the rows have no residual."""
    state, targets, p = tick.state, tick.targets, tick.parameters
    linear = linear_momentum_rows(state, targets, p)
    angular = angular_momentum_rows(state, targets, p, tick.cop_vel)
    A, b = np.vstack([linear.A, angular.A]), np.concatenate([linear.b, angular.b])
    vdot = np.linalg.lstsq(A, b, rcond=None)[0]
    rate = state.A @ vdot + state.Adot_v
    np.testing.assert_allclose(rate[:3], desired_linear_rate(state, targets, p), atol=1e-8)
    expected = desired_angular_rate(state, targets, p, tick.cop_vel)
    np.testing.assert_allclose(rate[3:], expected, atol=1e-8)


def test_constraints_hold_at_the_solution(tick):
    """Dynamics, sole motion, cones, torques and joint limits hold to rounding."""
    state, p = tick.state, tick.parameters
    x = solve(build(state, tick.targets, p, tick.cop_vel)).x
    for bounds in (f(state, p) for f in (root_dynamics, sole_motion, torque_limits, joint_limits)):
        value = bounds.C @ x[: bounds.C.shape[1]]
        assert np.all(value <= bounds.u + 1e-7) and np.all(value >= bounds.l - 1e-7)
    cones = sole_cones(state, p)
    assert (cones.C @ x).max() < 1e-7
    np.testing.assert_allclose(
        torques_of(state, x), torque_matrix(state) @ x + state.h[6:], atol=1e-9
    )


def test_cones_are_given_in_the_axes_of_the_soles(tick):
    """A force along a sole's own normal is inside, one that is tilted too far is not."""
    state, p = tick.state, tick.parameters
    cones = sole_cones(state, p)
    nv, n = len(state.qvel), len(state.qvel) + 12
    for i, axes in enumerate(state.sole_axes):
        for tilt, inside in ((0.0, True), (0.4, True), (0.7, False)):
            x = np.zeros(n)
            force = np.cos(tilt) * axes[:, 2] + np.sin(tilt) * axes[:, 0]
            x[nv + 6 * i : nv + 6 * i + 3] = force
            assert bool((cones.C @ x).max() <= 1e-12) is inside


def test_joint_limits_are_the_compiled_ones(tick, robot):
    """The bounds on v̇ are those of `braking_bounds` at any position and speed."""
    simulation, p = Simulation(robot), tick.parameters
    rng = np.random.default_rng(4)
    low, high = robot.joint_range.T
    for _ in range(10):
        qpos = robot.standing_qpos.copy()
        qpos[7:] = rng.uniform(low - 0.05, high + 0.05)
        state = simulation.reset(qpos, 4.0 * rng.normal(size=robot.model.nv))
        bounds = joint_limits(state, p)
        compiled = [
            braking_bounds(q, v, *limits, p.brake_accel, p.brake_horizon, p.brake_floor)
            for q, v, limits in zip(state.q, state.qvel[6:], robot.joint_range, strict=True)
        ]
        np.testing.assert_allclose(np.stack([bounds.l, bounds.u], axis=1), compiled, rtol=1e-12)


def test_a_task_without_cost_is_disabled(tick):
    """With ω_c = 0 the CoM's target does not matter; with its weight it does."""
    state, p = tick.state, tick.parameters
    far = replace(tick.targets, com=tick.targets.com + [0.1, 0.0, 0.0])
    without = p._replace(com_weight=np.zeros(3), angular_weight=np.zeros(3))
    x, y = (solve(build(state, t, without)).x for t in (tick.targets, far))
    np.testing.assert_allclose(x, y, atol=1e-9)
    x, y = (solve(build(state, t, p)).x for t in (tick.targets, far))
    assert np.abs(x - y).max() > 0.1


def test_users_may_add_a_task_and_a_constraint(tick):
    """Rows of one's own are tracked, and bounds of one's own are kept."""
    state, p = tick.state, tick.parameters
    j = 6 + robot_named("humanoid").joint_names.index("left_elbow")
    pick = np.eye(1, len(state.qvel), j)
    plain = build(state, tick.targets, p)
    wave = Rows(pick, np.array([7.0]), np.array([1e4]))
    assert solve(build(state, tick.targets, p, tasks=[wave])).x[j] == pytest.approx(7.0, abs=0.01)
    bound = Bounds(pick, np.array([3.0]), np.array([4.0]))
    bounded = build(state, tick.targets, p, constraints=[bound])
    assert 3.0 - 1e-9 <= solve(bounded).x[j] <= 4.0 + 1e-9
    assert not 3.0 <= solve(plain).x[j] <= 4.0
    assert len(bounded.l) == len(plain.l) + 1


def test_building_is_pure(tick):
    """Two builds give the same numbers, and neither the state nor the targets change."""
    state, targets = tick.state, tick.targets
    before = [array.copy() for array in (*state.arrays, *targets.arrays())]
    first, second = (build(state, targets, tick.parameters, tick.cop_vel) for _ in range(2))
    for name in "HgClu":
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    for a, b in zip(before, (*state.arrays, *targets.arrays()), strict=True):
        np.testing.assert_array_equal(a, b)
