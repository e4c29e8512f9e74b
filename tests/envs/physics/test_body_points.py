"""Points of any body against MuJoCo's functions, finite differences and the readable form."""

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.physics.body_points import body_point, point_motion, standing_frame, update_point
from poise.envs.physics.simulation import Simulation
from tests.support.physics import random_state, robot_named

OFFSET = (0.1, -0.05, 0.2)


@pytest.fixture(scope="module", params=[("humanoid", "left_lower_arm"), ("tall", None)])
def flying(request):
    """A simulation in a random state in the air, and a point of its last body."""
    name, body = request.param
    simulation = Simulation(robot_named(name))
    simulation.reset(*random_state(simulation.robot, np.random.default_rng(5)))
    body = body or simulation.model.body(simulation.model.nbody - 1).name
    return simulation, body_point(simulation.robot, body, OFFSET)


def test_motion_is_that_of_the_simulator(flying):
    """Position, J, J v and J̇ v, compiled and in NumPy, are those of mj_jac and mj_jacDot."""
    simulation, point = flying
    model, data, state = simulation.model, simulation.data, simulation.state
    update_point(state.arrays, point)
    R = data.xmat[point.body].reshape(3, 3)
    position = data.xpos[point.body] + R @ OFFSET
    J, Jdot = np.zeros((6, model.nv)), np.zeros((6, model.nv))
    mujoco.mj_jac(model, data, J[:3], J[3:], position, point.body)
    mujoco.mj_jacDot(model, data, Jdot[:3], Jdot[3:], position, point.body)
    for found in (point, point_motion(state, point)):
        np.testing.assert_allclose(found.position, position, atol=1e-13)
        np.testing.assert_allclose(found.J, J, atol=1e-12)
        np.testing.assert_allclose(found.J_v, J @ state.qvel, atol=1e-12)
        np.testing.assert_allclose(found.Jdot_v, Jdot @ state.qvel, atol=1e-10)
    np.testing.assert_allclose(point_motion(state, point).axes, R, atol=1e-15)


def test_motion_by_finite_differences(flying):
    """J v is the velocity of the point and the turning of the body's axes along q̇ = v."""
    simulation, point = flying
    now, h = point_motion(simulation.state, point), 1e-6
    then = []
    for sign in (-1.0, 1.0):
        other = Simulation(simulation.robot)
        qpos = simulation.state.qpos.copy()
        mujoco.mj_integratePos(simulation.model, qpos, simulation.state.qvel, sign * h)
        then.append(point_motion(other.reset(qpos, simulation.state.qvel), point))
    before, after = then
    velocity = (after.position - before.position) / (2 * h)
    np.testing.assert_allclose(now.J_v[:3], velocity, atol=1e-7)
    turning = (after.axes - before.axes) / (2 * h)
    np.testing.assert_allclose(np.cross(now.J_v[3:], now.axes.T).T, turning, atol=1e-7)
    np.testing.assert_allclose(now.Jdot_v, (after.J_v - before.J_v) / (2 * h), atol=1e-5)


def test_standing_frame_is_that_of_the_standing_robot():
    """Position and axes of a body are those of a simulation after its reset."""
    simulation = Simulation(robot_named("humanoid"))
    point = body_point(simulation.robot, "torso", OFFSET)
    position, axes = standing_frame(simulation.robot, point)
    motion = point_motion(simulation.state, point)
    np.testing.assert_allclose(position, motion.position, atol=1e-14)
    np.testing.assert_allclose(axes, motion.axes, atol=1e-14)


@pytest.mark.parametrize("body", ["nose", "world"])
def test_a_body_that_does_not_move_is_refused(body):
    """With the bodies that do."""
    with pytest.raises(ConfigError, match=f"no body '{body}'.*torso.*left_lower_arm"):
        body_point(robot_named("humanoid"), body, OFFSET)
