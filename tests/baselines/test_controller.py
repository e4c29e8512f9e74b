"""What a controller is given and what it must not know."""

from dataclasses import fields

import numpy as np
import pytest

from poise.baselines.controller import Controller, Targets
from poise.baselines.registry import load_controller
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, push, robot_named


@pytest.fixture(scope="module")
def robot():
    return robot_named("humanoid")


def test_standing_targets_are_met_by_the_standing_robot(robot):
    """Of a robot that stands as described, every target is where it is."""
    state = Simulation(robot).state
    targets = Targets.standing(robot, state)
    np.testing.assert_allclose(targets.q_ref, state.q, atol=1e-12)
    np.testing.assert_allclose(targets.root_axes, state.root_axes, atol=1e-6)
    assert targets.com[2] == pytest.approx(state.com[2], abs=1e-6)
    np.testing.assert_allclose(targets.com[:2], np.mean(state.sole_points, axis=0)[:2], atol=1e-12)
    np.testing.assert_array_equal(targets.cop, targets.com[:2])
    for name in ("v_ref", "a_ref", "root_vel", "root_acc", "com_vel", "com_acc"):
        assert not getattr(targets, name).any()


def test_targets_are_shared_with_compiled_code(robot):
    """Writing into a target reaches the controller; two Targets share nothing."""
    state = Simulation(robot).state
    first, second = Targets.standing(robot, state), Targets.standing(robot, state)
    arrays = first.arrays()
    first.com[0] += 0.05
    assert arrays.com[0] == first.com[0] != second.com[0]
    first.com_vel[0] = 1.0
    assert second.com_vel[0] == 0.0
    qp = controller(robot)
    moved = qp.torques(state, first)
    qp.reset(state)
    assert np.abs(moved - qp.torques(state, second)).max() > 1.0


def test_targets_take_the_values_of_others(robot):
    """Every field, into arrays of their own."""
    state = Simulation(robot).state
    ours, theirs = (Targets.standing(robot, state) for _ in range(2))
    for i, item in enumerate(fields(Targets)):
        getattr(theirs, item.name)[:] = i + 1.0
    ours.take(theirs)
    for item in fields(Targets):
        own, other = getattr(ours, item.name), getattr(theirs, item.name)
        np.testing.assert_array_equal(own, other)
        assert own is not other


def test_momentum_qp_is_a_controller(robot):
    """It has a period, `reset` and `torques`, and returns its own array of torques."""
    qp: Controller = load_controller("momentum-qp", robot)
    state = Simulation(robot).state
    qp.reset(state)
    torques = qp.torques(state, Targets.standing(robot, state))
    assert isinstance(qp, MomentumQP) and qp.period > 0.0
    assert torques.shape == (robot.model.nu,)
    kept = torques.copy()
    qp.torques(state, Targets.standing(robot, state))
    np.testing.assert_array_equal(torques, kept)


def test_a_controller_does_not_see_the_push(robot):
    """While a push acts, torques are those for the same state without one; later they differ."""
    pushed, calm = Simulation(robot), Simulation(robot)
    pushed.reset(pushes=[push(robot, 0.3, 0.0, start=0.0)])
    calm.reset()
    ours, theirs = controller(robot), controller(robot)
    targets = Targets.standing(robot, calm.state)
    # the push is on from the first instant, and has moved nothing yet
    np.testing.assert_array_equal(
        ours.torques(pushed.state, targets), theirs.torques(calm.state, targets)
    )
    for simulation in (pushed, calm):
        simulation.step(np.zeros(robot.model.nu), 2)
    assert np.abs(pushed.data.xfrc_applied).max() > 10.0
    assert np.abs(pushed.state.qvel - calm.state.qvel).max() > 0.01
    # the same state without the push gives the same torques as with it
    copy = pushed.state.copy()
    ours.reset(copy)
    theirs.reset(copy)
    with_push = ours.torques(pushed.state, targets)
    pushed.set_pushes([])
    pushed.data.xfrc_applied[:] = 0.0
    np.testing.assert_array_equal(theirs.torques(copy, targets), with_push)


def test_reset_forgets(robot):
    """After a reset, the same states give the same torques, bit for bit."""
    qp, simulation = controller(robot), Simulation(robot)

    def trial():
        state = simulation.reset(pushes=[push(robot, 0.3, 45.0)])
        qp.reset(state)
        targets = Targets.standing(robot, state)
        out = []
        for _ in range(60):
            out.append(qp.torques(state, targets))
            state = simulation.step(out[-1], 2)
        return np.array(out)

    np.testing.assert_array_equal(trial(), trial())


@pytest.mark.parametrize(
    ("config", "field"),
    [
        ({"solver": "simplex"}, "solver"),
        ({"solver": "osqp", "solver_options": {"eps": 1e-3}}, "eps"),
        ({"root": "firm"}, "root"),
        ({"posture": {"stifness": 3.0}}, "stifness"),
        ({"com": {"weight": -1.0}}, "weight"),
        ({"period": float("nan")}, "period"),
    ],
)
def test_bad_configurations_are_refused(robot, config, field):
    """The error names the field."""
    with pytest.raises(ConfigError, match=field):
        load_controller(config, robot)
