"""The readable QP and the compiled one have the same solution; what users may add to it."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.solvers import make_solver
from poise.baselines.whole_body.constraint_rows import (
    Bounds,
    joint_limits,
    root_dynamics,
    sole_cones,
    sole_motion,
    torque_limits,
    torque_matrix,
)
from poise.baselines.whole_body.formulation import build, torques_of, unknowns
from poise.baselines.whole_body.tasks.com import CoM
from poise.baselines.whole_body.tasks.cop import CoP
from poise.baselines.whole_body.tasks.task import Rows
from tests.support.physics import recovery, robot_named


def solve(qp, name="daqp"):
    solution = make_solver(name).solve(qp)
    assert solution.solved
    return solution


def motors(state, torques):
    return torques[state.robot.motor_dofs - 6]


@pytest.mark.parametrize(
    ("name", "root", "believed"),
    [
        ("humanoid", "hard", {}),
        ("humanoid", "hard", {"load": (-30.0, 3.0, -5.0)}),
        ("humanoid", "hard", {"friction": 0.4}),
        ("humanoid", "soft", {}),
        ("tall", "hard", {}),
        ("toddler", "hard", {}),
    ],
)
def test_the_compiled_problem_has_the_same_solution(name, root, believed):
    """Torques, accelerations, wrenches and u_root agree along push recoveries: 1e-9 relative."""
    ticks = [tick for tick in recovery(name, root, **believed) if tick.solved]
    assert len(ticks) >= 50
    binding, leaning = 0, 0.0
    for tick in ticks:
        state = tick.state
        qp = build(state, tick.targets, tick.parameters, tick.tasks, tick.cop_vel)
        solution = solve(qp)
        vdot, w, u_root = unknowns(state, solution.x)
        torques = motors(state, torques_of(state, solution.x))
        pairs = [(torques, tick.torques), (vdot, tick.vdot), (w, tick.wrenches)]
        if root == "soft":
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
        qp = build(tick.state, tick.targets, tick.parameters, tick.tasks, tick.cop_vel)
        ours = torques_of(tick.state, solve(qp, "active-set").x)
        np.testing.assert_allclose(motors(tick.state, ours), tick.torques, atol=1e-7)


def test_constraints_hold_at_the_solution(tick):
    """Dynamics, sole motion, cones, torques and joint limits hold to rounding."""
    state, p = tick.state, tick.parameters
    x = solve(build(state, tick.targets, p, tick.tasks, tick.cop_vel)).x
    for bounds in (f(state, p) for f in (root_dynamics, sole_motion, torque_limits, joint_limits)):
        value = bounds.C @ x[: bounds.C.shape[1]]
        assert np.all(value <= bounds.u + 1e-7) and np.all(value >= bounds.l - 1e-7)
    cones = sole_cones(state, p)
    assert (cones.C @ x).max() < 1e-7
    np.testing.assert_allclose(
        torques_of(state, x), torque_matrix(state) @ x + state.h[6:], atol=1e-9
    )


def test_a_task_without_cost_is_disabled(tick):
    """Without CoM and CoP tasks the CoM's target does not matter; with them it does."""
    state, p = tick.state, tick.parameters
    far = replace(tick.targets, com=tick.targets.com + [0.1, 0.0, 0.0])
    without = [task for task in tick.tasks if not isinstance(task.part, CoM | CoP)]
    x, y = (solve(build(state, t, p, without)).x for t in (tick.targets, far))
    np.testing.assert_allclose(x, y, atol=1e-9)
    x, y = (solve(build(state, t, p, tick.tasks)).x for t in (tick.targets, far))
    assert np.abs(x - y).max() > 0.1


def test_users_may_add_a_task_and_a_constraint(tick):
    """Rows of one's own are tracked, and bounds of one's own are kept."""
    state, p = tick.state, tick.parameters
    j = 6 + robot_named("humanoid").joint_names.index("left_elbow")
    pick = np.eye(1, len(state.qvel), j)
    plain = build(state, tick.targets, p, tick.tasks)
    wave = Rows(pick, np.array([7.0]), np.array([1e4]))
    waving = build(state, tick.targets, p, [*tick.tasks, wave])
    assert solve(waving).x[j] == pytest.approx(7.0, abs=0.01)
    bound = Bounds(pick, np.array([3.0]), np.array([4.0]))
    bounded = build(state, tick.targets, p, tick.tasks, constraints=[bound])
    assert 3.0 - 1e-9 <= solve(bounded).x[j] <= 4.0 + 1e-9
    assert not 3.0 <= solve(plain).x[j] <= 4.0
    assert len(bounded.l) == len(plain.l) + 1


def test_building_is_pure(tick):
    """Two builds give the same numbers, and neither the state nor the targets change."""
    state, targets = tick.state, tick.targets
    before = [array.copy() for array in (*state.arrays.members(), *targets.arrays().members())]
    first, second = (
        build(state, targets, tick.parameters, tick.tasks, tick.cop_vel) for _ in range(2)
    )
    for name in "HgClu":
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    for a, b in zip(before, (*state.arrays.members(), *targets.arrays().members()), strict=True):
        np.testing.assert_array_equal(a, b)
