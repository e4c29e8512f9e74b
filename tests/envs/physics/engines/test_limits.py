"""Limits of joints follow MuJoCo's law in any engine."""

import importlib.util

import mujoco
import numpy as np
import pytest

from poise.envs.physics.engines.config import Physics
from poise.envs.physics.engines.limits import JointLimits
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot

LIMIT = int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
needs_drake = pytest.mark.skipif(
    importlib.util.find_spec("pydrake") is None, reason="Drake is not installed"
)


@pytest.fixture
def robot():
    """Without contact, so that limits alone act."""
    robot = load_robot()
    robot.model.geom_contype[:] = robot.model.geom_conaffinity[:] = 0
    return robot


@pytest.mark.parametrize("solref", [(0.02, 1.0), (0.001, 0.5), (-500.0, -20.0)])
def test_regularisation_and_reference_are_those_of_mujoco(robot, solref):
    model, data, rng = robot.model, mujoco.MjData(robot.model), np.random.default_rng(0)
    model.jnt_solref[:] = solref
    model.jnt_solimp[3], model.jnt_solimp[4] = (0.8, 0.8, 0.001, 0.5, 2), (0.5, 0.99, 0.02, 0.3, 1)
    model.jnt_solimp[5], model.jnt_margin[6] = (0.5, 0.99, 0.02, 0.3, 3), 0.002
    limits, met = JointLimits(robot), 0
    low, high = model.jnt_range[1:].T
    for _ in range(20):
        depth = rng.uniform(-0.001, 0.02, model.nv - 6)
        data.qpos[7:] = np.where(rng.random(model.nv - 6) < 0.5, low - depth, high + depth)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        rows = np.flatnonzero(data.efc_type == LIMIT)
        beyond = limits.beyond(data.qpos, data.qvel)
        np.testing.assert_array_equal(beyond.joints, data.efc_id[rows] - 1)
        np.testing.assert_allclose(beyond.regularisation, data.efc_R[rows], rtol=1e-12)
        np.testing.assert_allclose(beyond.sign * beyond.reference, data.efc_aref[rows], rtol=1e-9)
        met += len(rows)
    assert met > 200
    data.qpos[:] = robot.standing_qpos
    assert limits.beyond(data.qpos, data.qvel) is None


def thrown(robot, physics, timestep):
    """Joints every 20 ms of 0.2 s [rad], thrown against their limits in flight."""
    from poise.envs.physics.engines.drake import DrakeEngine

    robot.model.opt.timestep = timestep
    simulation = Simulation(robot)
    if physics.engine == "drake":
        simulation.engine = DrakeEngine(robot, simulation.data, physics)
    qpos, qvel = robot.standing_qpos.copy(), np.zeros(robot.model.nv)
    qpos[2] += 5.0
    qvel[6:] = 6.0 * np.random.default_rng(5).normal(size=robot.model.nv - 6)
    simulation.reset(qpos, qvel)
    course = []
    for _ in range(round(0.2 / timestep)):
        simulation.step(np.zeros(robot.model.nu))
        course.append(simulation.data.qpos[7:].copy())
    return np.array(course)[round(0.02 / timestep) - 1 :: round(0.02 / timestep)]


@needs_drake
def test_joints_thrown_against_their_limits_move_as_in_mujoco(robot):
    apart = []
    for timestep in (1e-3, 2.5e-4):
        one = thrown(robot, Physics(), timestep)
        other = thrown(robot, Physics("drake", substeps=1), timestep)
        apart.append(np.abs(one - other).max())
    beyond = np.maximum(robot.model.jnt_range[1:, 0] - one, one - robot.model.jnt_range[1:, 1])
    assert beyond.max() > 0.05  # [rad]
    assert apart[0] < 5e-3 and apart[1] < 0.3 * apart[0]
