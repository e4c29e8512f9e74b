"""envs/sensing/push_force.py: the force that pushes, from momentum and CoP alone."""

import mujoco
import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.sensing.push_force import forget_pushes, observe_push, push_force
from tests.support.physics import controller, robot_named

PERIOD = 0.004
ROBOT = robot_named("humanoid")
SUBSTEPS = round(PERIOD / ROBOT.model.opt.timestep)


def observed(push, seconds, smoothing=0.2, memory=20.0):
    """(F̂ (ticks, 2), F̄ (ticks, 2)) while `momentum-qp` stands under a push."""
    simulation, qp = Simulation(ROBOT), controller(ROBOT)
    simulation.reset(pushes=[push])
    qp.reset(simulation.state)
    targets = Targets.standing(ROBOT, simulation.state)
    targets.com[0] += qp.com_offset
    estimate, forces, means = push_force(ROBOT.omega, smoothing, memory), [], []
    for _ in range(round(seconds / PERIOD)):
        state = simulation.state
        observe_push(estimate, qp.arrays, state.arrays, PERIOD)
        forces.append(estimate.force.copy())
        means.append(estimate.mean.copy())
        simulation.step(qp.torques(state, targets), SUBSTEPS)
    return np.array(forces), np.array(means)


def lever():
    """z/h of the point of the torso that is pushed, while the robot stands."""
    standing = mujoco.MjData(ROBOT.model)
    standing.qpos[:] = ROBOT.standing_qpos
    mujoco.mj_kinematics(ROBOT.model, standing)
    return standing.body("torso").xipos[2] / ROBOT.height_com


@pytest.mark.parametrize("direction", [0.0, 120.0, 270.0])
def test_a_force_that_lasts_is_found_with_its_moment_about_the_ground(direction):
    """At rest under 15 N on the torso F̂ is F z/h, z the height of the point that is pushed."""
    force, seconds = 15.0, 6.0
    push = Push("torso", 0.5, 10.0, 10.0 * force, direction)
    found, _ = observed(push, seconds)
    angle = np.radians(direction)
    expected = force * lever() * np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(found[-250:].mean(axis=0), expected, atol=0.04 * force)
    before = found[round(0.35 / PERIOD) : round(0.48 / PERIOD)]  # when the start has settled
    assert np.abs(before).max() < 0.1 * force


@pytest.mark.parametrize("direction", [0.0, 90.0, 180.0])
def test_a_force_is_found_while_trunk_and_arms_turn(direction):
    """A tenth of a second after 60 N began F̂ is F z/h, though L̇/h is as large as F by then."""
    force = 60.0
    found, _ = observed(Push("torso", 0.5, 0.3, 0.3 * force, direction), 0.8, smoothing=0.07)
    angle = np.radians(direction)
    way = np.array([np.cos(angle), np.sin(angle)])
    during = found[round(0.6 / PERIOD) : round(0.78 / PERIOD)]
    np.testing.assert_allclose(during @ way, force * lever(), rtol=0.06)
    np.testing.assert_allclose(during @ [-way[1], way[0]], 0.0, atol=0.05 * force)


def test_the_mean_keeps_the_impulse_of_a_short_push():
    """F̄ T is the impulse a second after a push of 0.1 s, but for what it has leaked."""
    impulse, memory = 9.0, 400.0
    _, means = observed(Push("pelvis", 0.3, 0.1, impulse, 90.0), 2.5, memory=memory)
    seconds = memory / ROBOT.omega
    assert means[-1, 1] * seconds == pytest.approx(impulse, rel=0.25)
    assert abs(means[-1, 0]) * seconds < 0.25 * impulse


def test_without_support_nothing_is_learned():
    """In free fall there is no CoP, and the estimate stays what it was."""
    simulation = Simulation(ROBOT)
    qpos = ROBOT.standing_qpos.copy()
    qpos[2] += 0.5
    simulation.reset(qpos=qpos)
    estimate = push_force(ROBOT.omega)
    arrays = simulation.arrays
    for _ in range(20):
        simulation.step(np.zeros(ROBOT.model.nu), SUBSTEPS)
        observe_push(estimate, arrays, simulation.state.arrays, PERIOD)
    assert not estimate.force.any() and not estimate.mean.any()


def test_an_episode_begins_with_nothing():
    """`forget_pushes` makes the estimate what it is at first."""
    estimate = push_force(ROBOT.omega)
    estimate.force[:], estimate.mean[:], estimate.size, estimate.begun = 3.0, 3.0, 3.0, 1
    forget_pushes(estimate)
    fresh = push_force(ROBOT.omega)
    for name in ("force", "mean", "size", "begun"):
        np.testing.assert_array_equal(getattr(estimate, name), getattr(fresh, name))
