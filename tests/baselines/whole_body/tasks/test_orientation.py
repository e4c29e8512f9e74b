"""The task of a body's orientation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines import MomentumQP, Targets
from poise.baselines.registry import controller_config
from poise.baselines.whole_body.parts.part import bind_parts
from poise.baselines.whole_body.tasks.orientation import Orientation
from poise.envs.physics.simulation import Simulation
from tests.support.physics import robot_named
from tests.support.shared import generic_state
from tests.support.tasks import filled

ROBOT = robot_named("humanoid")


def bound(**gains):
    """The task of the torso."""
    return bind_parts({"trunk": Orientation("torso", **gains)}, ROBOT, "tasks")["trunk"]


def test_standing_is_what_it_wants():
    """At rest in the standing posture nothing is asked for, whichever way the robot faces."""
    rows = filled(bound(), Simulation(ROBOT).state)
    np.testing.assert_allclose(rows.b, 0.0, atol=1e-9)
    qpos = ROBOT.standing_qpos.copy()
    turn = Rotation.from_euler("z", 0.8)
    w, *xyz = qpos[3:7]
    x, y, z, w = (turn * Rotation.from_quat([*xyz, w])).as_quat()
    qpos[3:7] = w, x, y, z
    state = Simulation(ROBOT).reset(qpos)
    np.testing.assert_allclose(filled(bound(), state).b, 0.0, atol=1e-9)
    k = 20.0 * ROBOT.omega**2
    world = filled(bound(frame="world"), state)
    np.testing.assert_allclose(world.b, [0.0, 0.0, -0.8 * k], atol=1e-9 * k)


@pytest.mark.parametrize("angle", [0.01, 1.0, 2.5])
def test_a_turn_is_asked_back_by_its_angle(angle):
    """k times the angle, not its sine, about the axis in the world; a reference may be written."""
    task, state = bound(damping_ratio=0.0, frame="world"), Simulation(ROBOT).state
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    task.block.axes[:] = Rotation.from_rotvec(angle * axis).as_matrix() @ task.block.axes
    k = 20.0 * ROBOT.omega**2
    np.testing.assert_allclose(filled(task, state).b, k * angle * axis, atol=1e-8 * k)


def test_the_gains_have_the_robot_s_units():
    """k = stiffness ω², d = 2 ζ √k, the weight per (g/h)²: b and weights in a generic state."""
    state = generic_state().state
    base, more = (bound(stiffness=k, damping_ratio=z) for k, z in ((0.0, 0.0), (4.0, 0.5)))
    rows, rest = filled(more, state), filled(base, state)
    ω = ROBOT.omega
    velocity = rows.A @ state.qvel
    turn = (rows.b - rest.b + 2.0 * 0.5 * np.sqrt(4.0) * ω * velocity) / (4.0 * ω**2)
    error = Rotation.from_matrix(
        Rotation.from_euler("z", state.heading_yaw).as_matrix()
        @ more.block.axes
        @ state.arrays.body_axes[more.block.point.body].T
    ).as_rotvec()
    np.testing.assert_allclose(turn, error, atol=1e-9)
    np.testing.assert_allclose(rows.weights, 1.0 / ω**4)


def test_an_arm_is_held_where_its_task_wants_it():
    """Two seconds of standing with an arm turned: its orientation is reached, the robot stands."""
    arm = {"kind": "orientation", "body": "right_upper_arm", "weight": 100.0}
    config = controller_config({"base": "momentum-qp", "tasks": {"arm": arm}})
    controller, simulation = MomentumQP(ROBOT, config), Simulation(ROBOT)
    state, block = simulation.state, controller.tasks["arm"].block
    targets = Targets.standing(ROBOT, state)
    body = block.point.body
    free = _played(MomentumQP(ROBOT, controller_config("momentum-qp")), Simulation(ROBOT), targets)
    axis = np.array([1.0, -1.0, 1.0]) / np.sqrt(3.0)  # of the shoulder's first joint
    block.axes[:] = block.axes @ Rotation.from_rotvec(0.5 * axis).as_matrix()
    held = _played(controller, simulation, targets)
    errors = [
        np.linalg.norm(Rotation.from_matrix(s.arrays.body_axes[body].T @ block.axes).as_rotvec())
        for s in (free, held)
    ]
    assert errors[0] > 0.4 and errors[1] < 0.1
    assert controller.failures == 0
    assert np.linalg.norm(held.com_vel) < 0.01 and held.support_distance(held.com) > 0.02


def _played(controller, simulation, targets):
    state = simulation.state
    controller.reset(state)
    for _ in range(500):
        state = simulation.step(controller.torques(state, targets), 2)
    return state
