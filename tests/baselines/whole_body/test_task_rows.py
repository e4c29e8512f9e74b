"""Rows of the readable QP's tasks: what they ask for is what the equations say."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.whole_body.constraint_rows import (
    angular_momentum_rows,
    carrying_velocity,
    desired_angular_rate,
    desired_cop,
    desired_linear_rate,
    linear_momentum_rows,
    posture_rows,
)
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, recovery, robot_named, wrench_about


@pytest.fixture(scope="module")
def robot():
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def tick():
    """A state on the way back from a push, where limits bind."""
    return recovery()[30]


def test_posture_rows_vanish_on_the_reference_and_bring_back_to_it(robot):
    """On the reference v̇ = a_ref; beside it, v̇ leads every joint and the root to it."""
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
    stiff = replace(p, stiffness=np.ones(robot.model.nv), damping=np.zeros(robot.model.nv))
    step = posture_rows(state, targets, stiff).b
    mujoco.mj_integratePos(robot.model, qpos, step, 1.0)
    state = simulation.reset(qpos)
    np.testing.assert_allclose(state.q, targets.q_ref, atol=1e-9)
    np.testing.assert_allclose(state.root_axes, targets.root_axes, atol=1e-6)


def test_the_posture_counts_less_with_the_com_away(tick):
    """β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally, on all of the posture's weights."""
    targets = replace(tick.targets)
    p = replace(tick.parameters, far_share=0.1, far_distance=0.05)
    shares = []
    for away in ([0.0, 0.0, 0.4], [0.03, -0.04, 0.0], [9.0, 0.0, 0.0]):
        targets.com[:] = tick.state.com + away
        rows = posture_rows(tick.state, targets, p)
        shares.append(rows.weights[6:] / p.accel_weight[6:])
    for share, expected in zip(shares, (1.0, 0.1 + 0.9 / np.e, 0.1), strict=True):
        np.testing.assert_allclose(share, expected)


def test_desired_momentum_rates(tick):
    """Ṗ_des is a PD law on c; L̇_des has its moment from the force Ṗ_des − m g at p_des."""
    state, targets = tick.state, tick.targets
    p = replace(tick.parameters, com_stiffness=np.array([2.0, 3.0, 4.0]),
        com_damping=np.array([5.0, 6.0, 7.0]),
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


def test_carried_momentum(tick):
    """v* has the angular momentum asked for and moves neither the soles nor the CoM."""
    state, L_ref = tick.state, np.array([3.0, -2.0, 0.0])
    velocity = carrying_velocity(state, L_ref)
    np.testing.assert_allclose(state.A @ velocity, [0, 0, 0, *L_ref], atol=1e-9)
    np.testing.assert_allclose(state.J @ velocity, 0.0, atol=1e-9)
    targets = replace(tick.targets, angular_momentum=L_ref)
    moved = posture_rows(state, targets, tick.parameters).b
    still = posture_rows(state, tick.targets, tick.parameters).b
    np.testing.assert_allclose(moved - still, tick.parameters.damping * velocity, atol=1e-9)
    qp = controller(robot_named("humanoid"))
    qp.problem(state, targets)
    compiled = qp.workspace.accel_des[3:].copy()
    qp.problem(state, tick.targets)
    np.testing.assert_allclose(
        compiled - qp.workspace.accel_des[3:], (moved - still)[3:], atol=1e-4
    )
