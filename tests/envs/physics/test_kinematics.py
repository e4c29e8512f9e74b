"""Momentum, Jacobians, biases and contact against MuJoCo's functions and finite differences."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.controller import Targets
from poise.envs.physics.simulation import Simulation
from tests.support.physics import (
    contact_forces,
    controller,
    forward,
    push,
    random_state,
    robot_named,
    wrench_about,
)

ROBOTS = ("humanoid", "tall")  # tall: a root that does not face along its x axis


@pytest.fixture(params=[(name, seed) for name in ROBOTS for seed in range(3)])
def flying(request):
    """A simulation in a random state in the air."""
    name, seed = request.param
    simulation = Simulation(robot_named(name))
    simulation.reset(*random_state(simulation.robot, np.random.default_rng(seed)))
    return simulation


@pytest.fixture(scope="module")
def pushed():
    """A humanoid in the middle of a push, with the contact forces of this very instant."""
    robot = robot_named("humanoid")
    simulation = Simulation(robot)
    qp = controller(robot)
    state = simulation.reset(pushes=[push(robot, 0.3, 70.0)])
    targets = Targets.standing(robot, state)
    for _ in range(25):  # 0.1 s, so 0.02 s before the push ends
        state = simulation.step(qp.torques(state, targets), 2)
    assert np.abs(simulation.data.xfrc_applied).max() > 50.0
    forward(simulation)
    return simulation


def moved(simulation, dt):
    """The state that v leads to after dt."""
    qpos = simulation.state.qpos.copy()
    mujoco.mj_integratePos(simulation.model, qpos, simulation.state.qvel, dt)
    other = Simulation(simulation.robot)
    return other.reset(qpos, simulation.state.qvel)


def test_momentum_is_that_of_the_simulator(flying):
    """P, L and their matrices are mj_subtreeVel, m·mj_jacSubtreeCom and mj_angmomMat."""
    model, data, root = flying.model, flying.data, flying.robot.root_body_id
    state = flying.state
    mujoco.mj_subtreeVel(model, data)
    np.testing.assert_allclose(state.com, data.subtree_com[root], atol=1e-12)
    np.testing.assert_allclose(state.com_vel, data.subtree_linvel[root], atol=1e-12)
    np.testing.assert_allclose(state.linear_momentum / state.mass, state.com_vel, atol=1e-12)
    np.testing.assert_allclose(state.angular_momentum, data.subtree_angmom[root], atol=1e-10)
    A_P, A_L = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacSubtreeCom(model, data, A_P, root)
    mujoco.mj_angmomMat(model, data, A_L, root)
    np.testing.assert_allclose(state.A[:3], state.mass * A_P, atol=1e-11)
    np.testing.assert_allclose(state.A[3:], A_L, atol=1e-11)
    assert np.abs(state.angular_momentum).min() > 1e-3


def test_dynamics_are_those_of_the_simulator(flying):
    """M v̇ + h is the force that MuJoCo's own inverse dynamics asks for in the air."""
    model, data, state = flying.model, flying.data, flying.state
    vdot = np.random.default_rng(9).normal(size=model.nv)
    data.qacc[:] = vdot
    mujoco.mj_inverse(model, data)
    ours = state.M @ vdot + state.h
    np.testing.assert_allclose(ours, data.qfrc_inverse + data.qfrc_constraint, atol=1e-9)


def test_momentum_bias_is_the_derivative_of_A(flying):
    """Ȧ v is the change of A v along q̇ = v with v held."""
    h = 1e-5
    before, after = moved(flying, -h), moved(flying, h)
    change = (after.A @ after.qvel - before.A @ before.qvel) / (2 * h)
    size = np.abs(flying.state.Adot_v).max()
    assert size > 1.0
    np.testing.assert_allclose(flying.state.Adot_v, change, atol=1e-7 * size)


def test_sole_motion_is_that_of_the_simulator(flying):
    """Sole points, axes, J, J v and J̇ v are those of mj_jac and mj_jacDot."""
    model, data, state = flying.model, flying.data, flying.state
    for i, sole in enumerate(flying.robot.soles):
        R = data.xmat[sole.body_id].reshape(3, 3)
        point = data.xpos[sole.body_id] + R @ sole.position
        np.testing.assert_allclose(state.sole_points[i], point, atol=1e-13)
        np.testing.assert_allclose(state.sole_axes[i], R @ sole.rotation, atol=1e-13)
        J, Jdot = np.zeros((6, model.nv)), np.zeros((6, model.nv))
        mujoco.mj_jac(model, data, J[:3], J[3:], point, sole.body_id)
        mujoco.mj_jacDot(model, data, Jdot[:3], Jdot[3:], point, sole.body_id)
        rows = slice(6 * i, 6 * i + 6)
        np.testing.assert_allclose(state.J[rows], J, atol=1e-12)
        np.testing.assert_allclose(state.J_v[rows], J @ state.qvel, atol=1e-11)
        np.testing.assert_allclose(state.Jdot_v[rows], Jdot @ state.qvel, atol=1e-10)


def test_sole_motion_by_finite_differences(flying):
    """J v is how the sole moves and turns, J̇ v how that changes with v held."""
    h, now = 1e-5, flying.state
    before, after = moved(flying, -h), moved(flying, h)
    for i in range(len(flying.robot.soles)):
        rows = slice(6 * i, 6 * i + 6)
        turn = Rotation.from_matrix(after.sole_axes[i] @ before.sole_axes[i].T).as_rotvec()
        shift = after.sole_points[i] - before.sole_points[i]
        speed = np.concatenate([shift, turn]) / (2 * h)
        np.testing.assert_allclose(now.J_v[rows], speed, atol=1e-7)
        change = (after.J @ after.qvel - before.J @ before.qvel)[rows] / (2 * h)
        np.testing.assert_allclose(now.Jdot_v[rows], change, atol=1e-6)


def test_newton_euler(pushed):
    """A v̇ + A_bias is the wrench of the simulator's ground about the CoM, plus the push."""
    state, data = pushed.state, pushed.data
    ground = wrench_about(state.com, contact_forces(pushed))
    body = int(np.argmax(np.abs(data.xfrc_applied).max(axis=1)))
    applied = wrench_about(state.com, [(data.xipos[body], data.xfrc_applied[body, :3])])
    np.testing.assert_allclose(state.A @ data.qacc + state.A_bias, ground + applied, atol=1e-6)
    gravity = [0, 0, -state.mass * state.robot.gravity]
    rate = state.A @ data.qacc + state.Adot_v
    np.testing.assert_allclose(rate[:3], (ground + applied)[:3] + gravity, atol=1e-6)
    assert np.abs(rate).max() > 50.0


def test_cop_is_where_the_contact_forces_have_no_horizontal_moment():
    """After a step, the ground's wrench and the CoP are those of mj_contactForce in that step.

    The wrench is known to the second order of the turn of the root in the step.
    """
    robot = robot_named("humanoid")
    simulation, qp, shadow = Simulation(robot), controller(robot), Simulation(robot)
    state = simulation.reset(pushes=[push(robot, 0.28, 200.0)])
    targets, moving = Targets.standing(robot, state), 0.0
    for k in range(150):
        torques = qp.torques(state, targets)
        state = simulation.step(torques)
        if k > 70:  # 0.14 s: the push is over
            shadow.reset(state.qpos, state.qvel)
            shadow.data.ctrl[:] = torques
            forward(shadow)
            forces = contact_forces(shadow)
            state = simulation.step(torques)
            total = wrench_about(np.zeros(3), forces)
            np.testing.assert_allclose(state.contact_wrench, total, atol=0.02)
            if total[2] > 50.0:
                moment = wrench_about(np.array([*state.cop, 0.0]), forces)[3:5]
                np.testing.assert_allclose(moment, 0.0, atol=0.02)
                share = [force[2] * point[:2] for point, force in forces]
                middle = np.sum(share, axis=0) / total[2]
                np.testing.assert_allclose(state.cop, middle, atol=1e-3)  # contacts lie below z = 0
                moving = max(moving, np.linalg.norm(state.qvel[:3]))
    assert moving > 0.1


def test_angular_momentum_follows_the_cop(pushed):
    """L̇ = (p − c) × (Ṗ − m g) holds for the ground's wrench, but for the yaw moment about p."""
    state = pushed.state
    wrench = wrench_about(state.com, contact_forces(pushed))
    force, moment = np.split(wrench_about(np.zeros(3), contact_forces(pushed)), 2)
    p = np.array([-moment[1], moment[0], 0.0]) / force[2]
    free = wrench[3:] - np.cross(p - state.com, wrench[:3])
    np.testing.assert_allclose(free[:2], 0.0, atol=1e-6)
    assert abs(free[2]) > 0.01
    # and exactly for the wrench that has no moment about p
    pressure = wrench_about(state.com, [(p, wrench[:3])])
    np.testing.assert_allclose(pressure[3:], wrench[3:] - free, atol=1e-9)
