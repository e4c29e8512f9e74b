"""When the QP has no solution: damping takes over, it is counted, and the run goes on."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config
from poise.baselines.solvers import Solution, Status
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, robot_named


@pytest.fixture(scope="module")
def robot():
    return robot_named("humanoid")


@pytest.fixture
def failing(robot):
    """A controller that has solved one tick and will solve no other: a weight is not a number."""
    qp, simulation = controller(robot), Simulation(robot)
    targets = Targets.standing(robot, simulation.state)
    good = qp.torques(simulation.state, targets)
    assert qp.failures == 0
    return qp, simulation, targets, good, break_weight(qp)


def break_weight(qp):
    """Every problem is invalid until the return value is called."""
    weight = qp.tasks["com"].block.weight
    kept = weight.copy()
    weight[:] = np.nan
    return lambda: weight.__setitem__(slice(None), kept)


def test_torques_blend_into_damping(robot, failing):
    """Tick by tick the last good torques fade and joint damping takes their place."""
    qp, simulation, targets, good, _ = failing
    state = simulation.reset(
        robot.standing_qpos, 0.5 * np.random.default_rng(0).normal(size=robot.model.nv)
    )
    damping = -qp.memory.damping[qp.arrays.motor_dofs - 6] * state.qvel[qp.arrays.motor_dofs]
    shares = []
    for tick in range(1, 30):
        torques = qp.torques(state, targets)
        assert qp.failures == tick
        assert np.all(np.isfinite(torques)) and np.all(np.abs(torques) <= robot.torque_limit)
        share = np.dot(torques - damping, good - damping) / np.sum((good - damping) ** 2)
        np.testing.assert_allclose(torques, damping + share * (good - damping), atol=1e-9)
        shares.append(share)
    assert 0.5 < shares[0] < 1.0
    assert np.all(np.diff(shares) < 0.0) and shares[-1] < 0.01
    assert not qp.root_wrench.any()


def test_damping_takes_energy_out(failing):
    """What is left when the good torques have faded brakes every joint."""
    qp, simulation, targets, _, _ = failing
    state = simulation.state
    for _ in range(60):
        torques = qp.torques(state, targets)
        state = simulation.step(torques, 2)
    assert qp.failures == 60
    power = torques * simulation.state.qvel[qp.arrays.motor_dofs]
    assert np.all(np.isfinite(torques))
    assert power.sum() < 0.0


def test_a_solved_tick_ends_the_fallback(robot, failing):
    """As soon as the QP is solved again its torques count, and the next failure starts afresh."""
    qp, simulation, targets, good, mend = failing
    for _ in range(5):
        qp.torques(simulation.state, targets)
    mend()
    again = qp.torques(simulation.state, targets)
    np.testing.assert_allclose(again, good, atol=1e-6)
    assert qp.failures == 5
    break_weight(qp)
    np.testing.assert_allclose(qp.torques(simulation.state, targets), 0.8 * good, atol=1e-6)
    qp.reset(simulation.state)
    assert qp.failures == 0


@pytest.mark.parametrize("solver", ["active-set", "daqp"])
def test_a_weak_robot_is_no_error(robot, solver):
    """With motors of a millionth of their strength it falls; failures are counted in `info`."""
    config = controller_config("momentum-qp")
    config = replace(config, solver=solver, torque=replace(config.torque, share=1e-6))
    env = ResidualBalanceEnv(robot, controller=config, pushes=None, duration=3.0)
    observation, _ = env.reset(seed=0)
    for _ in range(env.max_steps):
        observation, reward, terminated, truncated, info = env.step(np.zeros(4))
        assert np.isfinite(observation).all() and np.isfinite(reward)
        if terminated or truncated:
            break
    assert terminated and info["solver_failures"] > 10


def test_a_solver_that_breaks_is_counted(robot, monkeypatch):
    """A solver that answers `invalid` with NaN leaves the run with finite torques."""
    qp = MomentumQP(robot, replace(controller(robot).config, solver="daqp"))
    simulation = Simulation(robot)
    targets = Targets.standing(robot, simulation.state)
    good = qp.torques(simulation.state, targets)
    nan = Solution(np.full(21, np.nan), np.full(1, np.nan), Status.INVALID, 0, 0.0)
    monkeypatch.setattr(qp.solver, "solve", lambda problem: nan)
    torques = qp.torques(simulation.state, targets)
    assert qp.failures == 1
    np.testing.assert_allclose(torques, 0.8 * good, atol=1e-6)


@pytest.mark.parametrize("entry", [3, 12])
def test_a_state_that_is_not_a_number_is_a_failure(robot, entry):
    """NaN in a velocity: the QP is not solved, no torque is NaN, and the next state is fine."""
    qp, simulation = controller(robot), Simulation(robot)
    targets = Targets.standing(robot, simulation.state)
    good = qp.torques(simulation.state, targets)
    broken = simulation.state.copy()
    broken.arrays.qvel[entry] = np.nan
    torques = qp.torques(broken, targets)
    assert qp.failures == 1
    assert np.all(np.isfinite(torques)) and np.all(np.abs(torques) <= robot.torque_limit)
    np.testing.assert_allclose(qp.torques(simulation.state, targets), good, atol=1e-6)
