"""Pushes: their forces, the compiled kernels against MuJoCo, the ankle limit."""

import copy

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from poise.envs.compiled.maths.pendulum import ankle_limit
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.physics.pushes.table import apply_kicks, apply_pushes, pack
from poise.envs.robots.robot import load_robot


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


@pytest.fixture
def floating(robot):
    """The standing robot without gravity and contacts, and its data at the standing posture."""
    model = copy.copy(robot.model)
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    return model, data


def root_name(robot):
    return robot.model.body(robot.root_body_id).name


def momenta(model, data, root):
    """Linear momentum and angular momentum about the centre of mass of the whole robot."""
    mujoco.mj_subtreeVel(model, data)
    mass = model.body_subtreemass[root]
    return mass * data.subtree_linvel[root], data.subtree_angmom[root].copy()


@pytest.mark.parametrize("profile", ["square", "half-sine"])
def test_force_integrates_to_the_impulse(profile):
    """The integral of force(t) is J along the direction, and the peak is the peak force."""
    push = Push("body", 0.2, 0.1, 12.0, 90.0, elevation=30.0, profile=profile)
    t = np.linspace(0.0, 0.5, 200_001)[:-1]
    force = push.force(t)
    expected = 12.0 * np.array([0.0, np.cos(np.pi / 6), 0.5])
    np.testing.assert_allclose(force.sum(axis=0) * (t[1] - t[0]), expected, atol=1e-3)
    assert np.linalg.norm(force, axis=1).max() == pytest.approx(push.peak_force, rel=1e-6)
    assert not push.force(0.15).any() and not push.force(0.31).any()


@pytest.mark.parametrize("profile", ["square", "half-sine"])
def test_steps_deliver_exactly_the_impulse(robot, profile):
    """Σ F dt = J to 1e-12 for any start and duration, also within one step."""
    rng = np.random.default_rng(1)
    dt = 0.002
    for duration in [*rng.uniform(1e-4, 0.3, 20), 0.1, 0.0013]:
        push = Push(root_name(robot), rng.uniform(0, 0.1), duration, 12.0, 40.0, profile=profile)
        table = pack([push], robot, 0.0)
        wrench = np.zeros((robot.model.nbody, 6))
        xmat = np.tile(np.eye(3).ravel(), (robot.model.nbody, 1))
        t = 0.0
        while t < 0.45:  # t runs as data.time does
            apply_pushes(table, t, dt, wrench, xmat)
            t += dt
        impulse = wrench[robot.root_body_id, :3] * dt
        expected = 12.0 * np.array([np.cos(np.radians(40)), np.sin(np.radians(40)), 0.0])
        np.testing.assert_allclose(impulse, expected, atol=1e-12 * 12.0)


def test_push_changes_the_momenta_of_a_free_robot(robot, floating):
    """A push changes linear momentum by J, angular momentum about the CoM by ∫ r × F dt."""
    model, data = floating
    model.opt.timestep = dt = 2e-5  # the integrator conserves momentum to first order in dt
    body = model.nbody - 1
    point, yaw = (0.05, -0.03, 0.1), 0.4
    push = Push(model.body(body).name, 0.0011, 0.0105, 3.0, 70.0, 20.0, point)
    table = pack([push], robot, yaw)
    arm = data.xipos[body] + data.xmat[body].reshape(3, 3) @ point - data.subtree_com[0]
    linear_before, angular_before = momenta(model, data, robot.root_body_id)
    for _ in range(round(0.013 / dt)):
        data.xfrc_applied[:] = 0.0
        apply_pushes(table, data.time, dt, data.xfrc_applied, data.xmat)
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    linear, angular = momenta(model, data, robot.root_body_id)
    azimuth, rise = np.radians(70.0) + yaw, np.radians(20.0)
    J = 3.0 * np.array(
        [np.cos(rise) * np.cos(azimuth), np.cos(rise) * np.sin(azimuth), np.sin(rise)]
    )
    np.testing.assert_allclose(linear - linear_before, J, atol=1e-3)  # halves with dt
    # the arm turns a little while the force acts, hence the looser tolerance
    expected = np.cross(arm, J)
    assert np.linalg.norm(expected) > 0.3
    np.testing.assert_allclose(
        angular - angular_before, expected, atol=0.03 * np.linalg.norm(expected)
    )


def test_kick_is_added_once_and_moves_the_whole_robot(robot, floating):
    """A kick adds Δv to the root once, rotated by the heading: the momentum gains m Δv."""
    model, data = floating
    kick = Kick(start=0.1, delta_v=0.5, direction=90.0)
    table = pack([kick], robot, np.pi / 2)  # left of a robot that faces +y is −x
    total, t, dt = np.zeros(model.nv), 0.0, 0.002
    for _ in range(200):
        apply_kicks(table, t, dt, total)
        t += dt
    np.testing.assert_allclose(total[:3], [-0.5, 0.0, 0.0], atol=1e-15)
    assert not total[3:].any()
    wrench = np.zeros((model.nbody, 6))
    apply_pushes(table, 0.1, dt, wrench, data.xmat)
    assert not wrench.any()

    data.qvel[:] = 0.0
    apply_kicks(table, 0.0999, dt, data.qvel)
    mujoco.mj_forward(model, data)
    linear, _ = momenta(model, data, robot.root_body_id)
    np.testing.assert_allclose(linear, [-0.5 * robot.mass, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("clock", ["count", "sum"])
def test_a_kick_on_a_step_boundary_is_added_once(robot, clock):
    """Whether time is k dt or a running sum, rounding neither loses nor doubles a kick."""
    dt = 0.002
    table = pack([Kick(0.0, 1.0, 0.0)], robot, 0.0)
    times = [k * dt if clock == "count" else sum([dt] * k) for k in range(300)]
    for k in range(0, 290):
        table["start"][0] = k * 2 / 1000  # the decimal number that a user writes
        steps = np.zeros((len(times), robot.model.nv))
        for t, qvel in zip(times, steps, strict=True):
            apply_kicks(table, t, dt, qvel)
        assert np.flatnonzero(steps[:, 0]).tolist() == [k]


@pytest.mark.parametrize("profile", ["square", "half-sine"])
@pytest.mark.parametrize("duration", [0.02, 0.1, 0.4])
def test_ankle_limit_brings_the_capture_point_to_the_edge(profile, duration):
    """c̈ = ω²(c − p) + F/m with p at the edge ends a push of the limit with ξ = p exactly."""
    omega, margin = 3.5, 0.1
    push = Push("body", 0.0, duration, ankle_limit(omega, margin, duration, profile), 0.0)
    push = Push("body", 0.0, duration, push.impulse, 0.0, profile=profile)

    def pendulum(t, x):
        return [x[1], omega**2 * (x[0] - margin) + push.force(min(t, duration * (1 - 1e-12)))[0]]

    end = solve_ivp(pendulum, (0.0, duration), [0.0, 0.0], rtol=1e-10, atol=1e-13).y[:, -1]
    assert end[0] + end[1] / omega == pytest.approx(margin, abs=1e-9)


def test_ankle_limit_of_an_instantaneous_push():
    """As T → 0 the limit is ω δ for both profiles."""
    for profile in ("square", "half-sine"):
        assert ankle_limit(3.5, 0.1, 1e-9, profile) == pytest.approx(0.35, rel=1e-8)


def test_several_pushes_add_up(robot):
    """Two pushes on one body at one time give the sum of both forces."""
    name, dt = root_name(robot), 0.002
    pushes = [Push(name, 0.0, 0.1, 5.0, 0.0), Push(name, 0.0, 0.1, 5.0, 90.0)]
    wrench = np.zeros((robot.model.nbody, 6))
    xmat = np.tile(np.eye(3).ravel(), (robot.model.nbody, 1))
    apply_pushes(pack(pushes, robot, 0.0), 0.05, dt, wrench, xmat)
    np.testing.assert_allclose(wrench[robot.root_body_id], [50, 50, 0, 0, 0, 0], atol=1e-12)
