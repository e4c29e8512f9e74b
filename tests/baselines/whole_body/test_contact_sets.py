"""The momentum QP with some of the soles: the readable problem, physics, limits of load."""

import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.swing import SwingTask
from poise.baselines.controller import Targets
from poise.baselines.solvers import make_solver, residuals
from poise.baselines.whole_body.contact_sets import ContactSets
from poise.baselines.whole_body.formulation import build, unknowns
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.baselines.whole_body.tick import go_on_from
from poise.envs.physics.simulation import Simulation
from tests.support import contact_sets
from tests.support.shared import generic_state, robot
from tests.support.tasks import filled, swing

SETS = [(0,), (1,), (0, 1)]


@pytest.fixture(scope="module")
def sets():
    return ContactSets(robot(), MomentumQPConfig())


def situation(seed=0, **weights):
    """A pushed robot, its standing targets, and the task for a step of its left foot."""
    state = generic_state(seed=seed).state
    targets = Targets.standing(robot(), state)
    reference = np.array([state.sole_points[0], [0.5, 0.0, 0.2], [2.0, 0.0, 1.0]])
    return state, targets, swing(state, 0, reference, state.sole_axes[0], SwingTask(**weights))


def test_both_soles_are_the_momentum_qp(sets):
    """With all soles and no further rows it is the baseline's problem, number by number."""
    state, targets, _ = situation()
    qp = MomentumQP(robot()).problem(state, targets)
    same = contact_sets.problem(sets, state, targets, (0, 1))
    np.testing.assert_array_equal(same.H, qp.H)
    np.testing.assert_array_equal(same.g, qp.g)
    finite = np.isfinite(same.u)
    assert finite.sum() == np.isfinite(qp.u).sum() + 2 * 1  # the rows kept for limits of load


@pytest.mark.parametrize("soles", SETS)
def test_solution_is_that_of_the_readable_problem(sets, soles):
    """Eliminated or not, with the swing rows or not: the same accelerations and wrenches."""
    state, targets, task = situation()
    chosen = sets.sets[soles]
    tasks = [task] if 0 not in soles else []
    contact_sets.tick(sets, state, targets, soles, tasks)
    assert sets.failures == 0
    restricted = contact_sets.restricted(sets, state, targets, soles)
    p, rows = chosen.parameters, [filled(each, state) for each in tasks]
    tasks = [*sets.tasks.values(), *rows]
    qp = build(restricted, targets, p, tasks, chosen.workspace.cop_vel)
    solution = make_solver("active-set").solve(qp)
    assert solution.solved
    vdot, wrenches, _ = unknowns(restricted, solution.x)
    scale = np.abs(vdot).max()
    np.testing.assert_allclose(chosen.workspace.vdot, vdot, atol=1e-4 * scale)
    np.testing.assert_allclose(chosen.workspace.wrenches, wrenches, atol=1e-3 * state.mass)


@pytest.mark.parametrize("soles", SETS)
def test_optimality_conditions(sets, soles):
    """No row is violated, the gradient vanishes, the duality gap is closed."""
    state, targets, task = situation(seed=1)
    qp = contact_sets.problem(sets, state, targets, soles, [task] if 0 not in soles else [])
    solution = make_solver("active-set").solve(qp)
    assert solution.solved
    left, scale = residuals(qp, solution), np.abs(qp.g).max()
    assert left.primal < 1e-8
    assert left.dual < 1e-8 * scale
    assert left.gap < 1e-7 * scale


@pytest.mark.parametrize("soles", SETS)
def test_motion_obeys_physics_and_leaves_the_stance(sets, soles):
    """Root rows of M v̇ + h = Jᵀw with the wrenches of the soles in contact only; they rest."""
    state, targets, task = situation()
    _, ws = contact_sets.tick(sets, state, targets, soles, [task] if 0 not in soles else [])
    chosen = sets.sets[soles]
    own = (6 * np.array(soles)[:, None] + np.arange(6)).ravel()
    J = state.J[own]
    force = state.M @ ws.vdot + state.h - J.T @ ws.wrenches
    np.testing.assert_allclose(force[:6], 0.0, atol=1e-6)
    needed = -chosen.parameters.sole_damping * state.J_v[own] - state.Jdot_v[own]
    np.testing.assert_allclose(J @ ws.vdot, needed, atol=1e-6)


def test_swing_rows_move_the_free_foot(sets):
    """A heavy swing task is met: the free sole accelerates as asked."""
    usual = SwingTask()
    state, targets, task = situation(weight=1e6 * usual.weight, turn_weight=1e6 * usual.turn_weight)
    _, ws = contact_sets.tick(sets, state, targets, (1,), [task])
    rows = filled(task, state)
    np.testing.assert_allclose(rows.A @ ws.vdot, rows.b, atol=1.0)


def test_load_limits_bind(sets):
    """A sole whose load is limited carries no more; without limits it would."""
    simulation = Simulation(robot())
    state = simulation.state
    targets = Targets.standing(robot(), state)
    _, ws = contact_sets.tick(sets, state, targets, (0, 1))
    free = ws.wrenches[2]
    limits = np.array([0.2 * free, np.inf])
    _, ws = contact_sets.tick(sets, state, targets, (0, 1), load_limits=limits)
    wrenches = ws.wrenches
    assert sets.failures == 0
    assert wrenches[2] == pytest.approx(0.2 * free, rel=1e-6)
    assert wrenches[8] > free


def test_torques_follow_those_of_before():
    """With a bound on changes the torques stay near those followed, and the plan knows of it."""
    limit = robot().torque_limit
    bounded = ContactSets(robot(), MomentumQPConfig(), torque_rate_limit=0.3)
    state, targets, task = situation()
    joints = bounded.arrays.motor_dofs - 6
    before = np.zeros(len(bounded.parameters.torque_limit))
    free, _ = contact_sets.tick(bounded, state, targets, (1,), [task])
    assert np.abs(free / limit).max() > 0.3
    bounded.reset()
    go_on_from(bounded.bind((1,), state.arrays, targets.arrays()), before)
    torques, ws = contact_sets.tick(bounded, state, targets, (1,), [task])
    assert np.abs(torques / limit).max() <= 0.3 + 1e-9
    planned = state.M @ ws.vdot + state.h - state.J[6:].T @ ws.wrenches
    assert bounded.failures == 0
    np.testing.assert_allclose(planned[6:][joints], torques, atol=1e-5)
