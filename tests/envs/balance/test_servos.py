"""Servos: their gains, what they hold, and their law."""

import mujoco
import numpy as np
import pytest

from poise.envs.balance.servos import ServoConfig, aim, drive, holding_torques, make_servos
from poise.envs.physics.simulation import Simulation
from tests.support.refused import invalid
from tests.support.shared import generic_state, robot

NAMES = [robot().joint_names[dof - 6] for dof in robot().motor_dofs]


def of(values, joint):
    return values[NAMES.index(joint)]


@pytest.mark.parametrize("name", ["humanoid", "tall", "compact", "toddler"])
def test_the_law(name):
    """τ = clip(K (q* − q) − D q̇, ± limit), q* = hold + reach · a, at generic points."""
    simulation, r = generic_state(name), robot(name)
    servos = make_servos(r, ServoConfig(reach={"*": 0.4}))
    q, v = simulation.state.qpos[r.motor_dofs + 1], simulation.state.qvel[r.motor_dofs]
    action = np.random.default_rng(2).uniform(-1.0, 1.0, r.model.nu)
    aim(servos, action)
    drive(servos, simulation.world())
    wanted = servos.stiffness * (servos.hold + 0.4 * action - q) - servos.damping * v
    expected = np.clip(wanted, -r.torque_limit, r.torque_limit)
    np.testing.assert_allclose(simulation.data.ctrl, expected, rtol=1e-12, atol=1e-9)
    full = abs(expected) == r.torque_limit
    assert full.any() and not full.all()  # limited and not


def test_stiffness_by_strength_and_by_load():
    """Hips by their motors; ankles carry twice half of the body's m g h."""
    r, servos = robot(), make_servos(robot(), ServoConfig())
    assert of(servos.stiffness, "left_hip_y") == pytest.approx(120.0 / 0.3)
    assert of(servos.stiffness, "right_elbow") == pytest.approx(10.0 / 0.3)
    data = mujoco.MjData(r.model)
    data.qpos[:] = r.standing_qpos
    mujoco.mj_kinematics(r.model, data)
    height = r.height_com - data.xanchor[r.model.joint("left_ankle_y").id][2]
    assert of(servos.stiffness, "left_ankle_y") == pytest.approx(r.mass * 9.81 * height, rel=1e-6)
    soft = make_servos(r, ServoConfig(carry=0.0))
    assert of(soft.stiffness, "left_ankle_y") == pytest.approx(20.0 / 0.3)


def test_damping_is_that_of_the_free_joint():
    """D = 2 ζ √(K I), I = 1/(M⁻¹)_jj of the standing robot."""
    servos = make_servos(robot(), ServoConfig(damping_ratio=0.7))
    inertia = 1.0 / np.diag(np.linalg.inv(Simulation(robot()).state.M))[robot().motor_dofs]
    expected = 1.4 * np.sqrt(servos.stiffness * inertia)
    np.testing.assert_allclose(servos.damping, expected, rtol=1e-6)


def test_values_by_name_win():
    """A pattern for some, an exact name before it; the others are as they were."""
    config = ServoConfig(
        stiffness={"*_knee": 50.0, "left_knee": 60.0},
        damping={"left_elbow": 0.5},
        reach={"*_knee": 0.4, "*": 0.9},
    )
    servos, plain = make_servos(robot(), config), make_servos(robot(), ServoConfig())
    assert of(servos.stiffness, "left_knee") == 60.0 and of(servos.stiffness, "right_knee") == 50.0
    assert of(servos.damping, "left_elbow") == 0.5
    assert of(servos.reach, "left_knee") == 0.4 and of(servos.reach, "left_elbow") == 0.9
    assert of(servos.stiffness, "left_elbow") == of(plain.stiffness, "left_elbow")


@pytest.mark.parametrize("name", ["humanoid", "tall", "compact", "toddler"])
def test_what_holds_the_posture(name):
    """With the ground's forces below the CoM these torques balance every joint at rest."""
    r, simulation = robot(name), Simulation(robot(name))
    torques, state = holding_torques(r), simulation.state
    inner = simulation.data.qfrc_bias - simulation.data.qfrc_passive
    inner[r.motor_dofs] -= torques
    # what is left over is the ground's: a weight on either side, and moments about x and y of each
    wrenches, *_ = np.linalg.lstsq(state.J.T, inner, rcond=None)
    np.testing.assert_allclose(state.J.T @ wrenches, inner, atol=1e-3 * r.mass)
    assert wrenches[[2, 8]].sum() == pytest.approx(r.mass * 9.81, rel=1e-6)
    assert abs(torques).max() > 0.01 * r.mass


@pytest.mark.parametrize(
    ("config", "error"),
    [
        ({"stiffness": {"tail": 1.0}}, ("servos.stiffness", "'tail'", "left_knee")),
        ({"damping": {"tail": 1.0}}, ("servos.damping", "'tail'")),
        ({"reach": {"*_knee": 1.0}}, ("servos.reach",)),
    ],
)
def test_joints_that_there_are_not(config, error):
    with invalid(*error):
        make_servos(robot(), ServoConfig(**config))
