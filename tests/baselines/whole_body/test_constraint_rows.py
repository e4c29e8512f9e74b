"""Rows of the readable QP's dynamics, contacts and limits, against the simulator."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from poise.baselines.whole_body.constraint_rows import joint_limits, root_dynamics, sole_cones
from poise.baselines.whole_body.constraints import braking_bounds
from poise.baselines.whole_body.contacts.wrench_cone import robot_cones
from poise.baselines.whole_body.formulation import torques_of
from poise.envs.physics.simulation import Simulation
from tests.support.physics import (
    contact_forces,
    controller,
    forward,
    random_state,
    robot_named,
    wrench_about,
)


@pytest.mark.parametrize("name", ["humanoid", "compact", "tall"])
def test_the_simulator_obeys_the_dynamics_rows(name):
    """MuJoCo's accelerations and contact forces satisfy the root rows and give back τ."""
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


def test_cones_are_given_in_the_axes_of_the_soles(robot):
    """However the feet are turned, a force along a sole's normal is inside, a flat one not."""
    state = Simulation(robot).reset(*random_state(robot, np.random.default_rng(6)))
    cones = sole_cones(state, controller(robot).parameters)
    nv = len(state.qvel)
    for i, axes in enumerate(state.sole_axes):
        for tilt, inside in ((0.0, True), (0.4, True), (0.8, False)):
            x = np.zeros(nv + 12)
            force = np.cos(tilt) * axes[:, 2] + np.sin(tilt) * axes[:, 0]
            x[nv + 6 * i : nv + 6 * i + 3] = force
            assert bool((cones.C @ x).max() <= 1e-12) is inside


@pytest.mark.parametrize("share", [0.3, 0.55, 1.0])
def test_cones_of_less_friction_are_those_of_soles_that_have_it(robot, share):
    """Any wrench is inside the cones of a believed share of friction or of neither."""
    simulation = Simulation(robot)
    state = simulation.reset(*random_state(robot, np.random.default_rng(8)))
    p = controller(robot).parameters
    simulation.state_arrays.friction = share
    narrow = sole_cones(state, p).C
    simulation.state_arrays.friction = 1.0
    contact = controller(robot).config.contact
    own = robot_cones(robot, share * contact.friction_share, contact.polygon_share)
    given = sole_cones(state, replace(p, cone=own)).C
    nv, rng, inside = len(state.qvel), np.random.default_rng(9), 0
    for _ in range(2000):
        x = np.zeros(nv + 12)
        for i, axes in enumerate(state.sole_axes):
            force = axes @ [*rng.uniform(-0.3, 0.3, 2), 1.0]
            moment = axes @ (rng.uniform(-1.0, 1.0, 3) * [0.05, 0.08, 0.02])
            x[nv + 6 * i : nv + 6 * i + 6] = [*force, *moment]
        both = (narrow @ x).max(), (given @ x).max()
        assert (both[0] <= 0.0) == (both[1] <= 0.0) or min(np.abs(both)) < 1e-9
        inside += both[0] <= 0.0
    assert 20 < inside < 1900


def test_joint_limits_are_the_compiled_ones(tick, robot):
    """The bounds on v̇ are those of `braking_bounds` at any position and speed."""
    simulation, p = Simulation(robot), tick.parameters
    rng = np.random.default_rng(4)
    low, high = robot.joint_range.T
    for _ in range(10):
        qpos = robot.standing_qpos.copy()
        qpos[7:] = rng.uniform(low - 0.05, high + 0.05)
        state = simulation.reset(qpos, 15.0 * rng.normal(size=robot.model.nv))
        bounds = joint_limits(state, p)
        compiled = [
            braking_bounds(q, v, *limits, p.brake_accel, p.brake_horizon, p.brake_floor)
            for q, v, limits in zip(state.q, state.qvel[6:], robot.joint_range, strict=True)
        ]
        assert np.any(bounds.u == -p.brake_floor)
        np.testing.assert_allclose(np.stack([bounds.l, bounds.u], axis=1), compiled, rtol=1e-12)
