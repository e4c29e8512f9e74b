"""Rows of the standard tasks: what they ask for is what the equations say."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.whole_body.tasks.com import CoM
from poise.baselines.whole_body.tasks.cop import CoP, desired_cop, desired_moment
from poise.baselines.whole_body.tasks.posture import Posture, carrying_velocity
from poise.baselines.whole_body.tasks.task import Bound, all_rows, task_input
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, robot_named, wrench_about


def bound(task, **numbers):
    """A task for the humanoid with some numbers of its block changed."""
    return Bound(task, replace(task.bind(robot_named("humanoid")), **numbers))


def test_posture_rows_vanish_on_the_reference_and_bring_back_to_it(robot):
    """On the reference v̇ = a_ref; beside it, v̇ leads every joint and the root to it."""
    simulation = Simulation(robot)
    state = simulation.state
    targets = Targets.standing(robot, state)
    targets.a_ref[:] = np.arange(len(targets.a_ref))
    rows = bound(Posture()).rows(task_input(state, targets))
    np.testing.assert_allclose(rows.b[6:], targets.a_ref, atol=1e-9)
    np.testing.assert_allclose(rows.b[:6], 0.0, atol=1e-6)

    rng = np.random.default_rng(0)
    qpos = robot.standing_qpos.copy()
    mujoco.mj_integratePos(robot.model, qpos, 0.3 * rng.normal(size=robot.model.nv), 1.0)
    state = simulation.reset(qpos)
    targets.a_ref[:] = 0.0
    nv = robot.model.nv
    stiff = bound(Posture(), stiffness=np.ones(nv), damping=np.zeros(nv))
    step = stiff.rows(task_input(state, targets)).b
    mujoco.mj_integratePos(robot.model, qpos, step, 1.0)
    state = simulation.reset(qpos)
    np.testing.assert_allclose(state.q, targets.q_ref, atol=1e-9)
    np.testing.assert_allclose(state.root_axes, targets.root_axes, atol=1e-6)


def test_the_posture_counts_less_with_the_com_away(tick):
    """β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally, on all of the posture's weights."""
    targets, shares = replace(tick.targets), []
    task = bound(Posture(), far_share=0.1, far_distance=0.05)
    for away in ([0.0, 0.0, 0.4], [0.03, -0.04, 0.0], [9.0, 0.0, 0.0]):
        targets.com[:] = tick.state.com + away
        rows = task.rows(task_input(tick.state, targets))
        shares.append(rows.weights[6:] / task.block.weight[6:])
    for share, expected in zip(shares, (1.0, 0.1 + 0.9 / np.e, 0.1), strict=True):
        np.testing.assert_allclose(share, expected)


def test_desired_momentum_rates(tick):
    """Ṗ_des is a PD law on c; L̇_des has its moment from the force Ṗ_des − m g at p_des."""
    state, targets = tick.state, tick.targets
    com = bound(CoM(), stiffness=np.array([2.0, 3.0, 4.0]), damping=np.array([5.0, 6.0, 7.0]))
    cop = bound(CoP(), horizon=0.1, stiffness=10.0, damping=2.0, angular_damping=3.0)
    moving = replace(targets, com_vel=np.array([0.1, 0.2, 0.3]), com_acc=np.array([1.0, 2.0, 3.0]))
    cop_vel = np.array([0.3, -0.2])
    given = task_input(state, moving, cop_vel=cop_vel)
    linear, angular = all_rows([com, cop], given)
    rate = linear.b + state.Adot_v[:3]
    for i in range(3):
        accel = (i + 1.0) + (i + 2.0) * (targets.com[i] - state.com[i])
        accel += (i + 5.0) * (0.1 * (i + 1) - state.com_vel[i])
        assert rate[i] == pytest.approx(state.mass * accel, rel=1e-12)
    p_des = desired_cop(given, cop.block)
    expected = state.cop + 0.1 * cop_vel
    expected += 0.005 * (-10.0 * (state.cop - targets.cop) - 2.0 * cop_vel)
    np.testing.assert_allclose(p_des, [*expected, state.origin[2]], atol=1e-12)
    for force, found in (
        (rate + [0.0, 0.0, state.mass * 9.81], angular.b + state.Adot_v[3:]),
        ([0.0, 0.0, state.mass * 9.81], desired_moment(given, cop.block)),  # no CoM task before
    ):
        moment = (
            wrench_about(state.com, [(p_des, np.array(force))])[3:] - 3.0 * state.angular_momentum
        )
        np.testing.assert_allclose(found, moment, atol=1e-9)


def test_momentum_rows_are_met_by_the_motion_they_ask_for(tick):
    """Where v̇ gives Ṗ_des and L̇_des, the rows have no residual."""
    state, targets = tick.state, tick.targets
    com, cop = bound(CoM()), bound(CoP())
    given = task_input(state, targets, cop_vel=tick.cop_vel)
    linear, angular = all_rows([com, cop], given)
    A, b = np.vstack([linear.A, angular.A]), np.concatenate([linear.b, angular.b])
    rate = state.A @ np.linalg.lstsq(A, b, rcond=None)[0] + state.Adot_v
    gains = com.block
    accel = targets.com_acc + gains.stiffness * (targets.com - state.com)
    accel += gains.damping * (targets.com_vel - state.com_vel)
    np.testing.assert_allclose(rate[:3], state.mass * accel, atol=1e-8)
    force = rate[:3] + [0.0, 0.0, state.mass * 9.81]
    expected = desired_moment(given._replace(force=force), cop.block)
    np.testing.assert_allclose(rate[3:], expected, atol=1e-8)


def test_carried_momentum(tick):
    """v* has the angular momentum asked for and moves neither the soles nor the CoM."""
    state, L_ref = tick.state, np.array([3.0, -2.0, 0.0])
    velocity = carrying_velocity(state, L_ref)
    np.testing.assert_allclose(state.A @ velocity, [0, 0, 0, *L_ref], atol=1e-9)
    np.testing.assert_allclose(state.J @ velocity, 0.0, atol=1e-9)
    targets = replace(tick.targets, angular_momentum=L_ref)
    qp = controller(robot_named("humanoid"))
    posture = qp.tasks["posture"]
    moved = posture.rows(task_input(state, targets)).b
    still = posture.rows(task_input(state, tick.targets)).b
    np.testing.assert_allclose(moved - still, posture.block.damping * velocity, atol=1e-9)
    qp.problem(state, targets)
    compiled = qp.workspace.accel_des[3:].copy()
    qp.problem(state, tick.targets)
    np.testing.assert_allclose(
        compiled - qp.workspace.accel_des[3:], (moved - still)[3:], atol=1e-4
    )
