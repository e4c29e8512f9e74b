"""QP for large deviations, PD for small ones; controllers by name."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.in_place.kudoh02 import Kudoh02, Kudoh02Config
from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import (
    controller_config,
    kinds,
    load_controller,
    momentum_qp_config,
)
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.envs.physics.simulation import Simulation
from tests.support.shared import robot
from tests.support.weekly import daily


@pytest.fixture
def standing():
    simulation = Simulation(robot())
    return simulation, Targets.standing(robot(), simulation.state)


def test_the_rule_and_its_hysteresis(standing):
    """PD near the goal, the QP beyond `far` until below `near`, then a blend back to PD."""
    simulation, targets = standing
    state, h = simulation.state, robot().height_com
    controller = Kudoh02(robot(), Kudoh02Config(near=0.02, far=0.05, blend=0.02))
    xi = simulation.state_arrays.capture_point

    def at(distance):
        xi[:] = targets.com[:2] + [distance * h, 0.0]
        return controller.torques(state, targets)

    pd = controller.pd.torques(state, targets)
    np.testing.assert_array_equal(at(0.04), pd)
    at(0.06)
    assert controller.large
    qp = MomentumQP(robot(), controller.config.qp)
    np.testing.assert_allclose(at(0.06), qp.torques(state, targets), atol=1e-6)
    at(0.03)
    assert controller.large  # not yet below `near`
    shares = []
    for _ in range(6):
        at(0.01)
        shares.append(controller._qp_fraction)
    np.testing.assert_allclose(shares, [0.8, 0.6, 0.4, 0.2, 0.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(at(0.01), pd)
    controller.reset()
    assert not controller.large


def test_thresholds_in_the_wrong_order_are_refused():
    """near > far."""
    with pytest.raises(ConfigError, match="near"):
        load_controller({"kind": "kudoh02", "near": 0.1, "far": 0.05}, robot())


def test_abe07_is_the_momentum_qp_without_cop_control():
    """Its weights fall with the CoM's distance, and nothing asks for a centre of pressure."""
    found, baseline = controller_config("abe07"), controller_config("momentum-qp")
    posture, cop = found.posture, found.cop
    assert posture.far_share == 0.02 and posture.far_distance == 0.02
    assert cop.weight == 0.0 and cop.yaw_weight == 0.0
    assert found == replace(baseline, posture=posture, cop=cop)
    controller = load_controller("abe07", robot())
    np.testing.assert_array_equal(controller.tasks["cop"].block.weight, 0.0)


@pytest.mark.parametrize("name", packaged("controllers"))
def test_every_packaged_controller_takes_a_light_push(name):
    """4 N·s from the side on the standing humanoid: still up after 1.2 s, nothing failed."""
    env = ResidualBalanceEnv(robot(), controller=name, pushes=None, duration=1.2)
    push = {"impulse": 4.0, "direction": 90.0, "duration": 0.1, "start": 0.3, "body": "torso"}
    env.reset(seed=0, options={"push": push})
    for _ in range(env.max_steps):
        _, terminated, _ = env.step_without_info(np.zeros(4))
        assert not terminated
    assert getattr(env.controller, "failures", 0) == 0


@pytest.mark.parametrize("name", daily(sorted({*packaged("controllers")} - {"get-up"}), 8))
def test_every_packaged_controller_suits_another_robot(name):
    """Gains are scaled by mass and height: `tall` stands for half a second. The postures of
    `get-up` name joints of the humanoid.
    """
    env = ResidualBalanceEnv(robot("tall"), controller=name, pushes=None, duration=0.5)
    env.reset(seed=0)
    for _ in range(env.max_steps):
        _, terminated, _ = env.step_without_info(np.zeros(4))
        assert not terminated


def test_kinds_are_named_in_the_error():
    """An unknown kind, and a `qp` that is not one."""
    with pytest.raises(ConfigError, match="kind.*lip-mpc"):
        load_controller({"kind": "magic"}, robot())
    with pytest.raises(ConfigError, match="controller: .*momentum-qp"):
        load_controller({"kind": "lqr-lip", "qp": "nothing"}, robot())
    with pytest.raises(ConfigError, match="gian"):
        load_controller({"kind": "capture-point", "gian": 1.0}, robot())


def test_some_commands_need_a_momentum_qp():
    """Others are refused by name, with those that will do."""
    assert momentum_qp_config("moskalev24").root == "soft"
    own = ", ".join(f"momentum-qp{of}" for of in ("", "-compensated", "-g1", "-h1", "-osqp", "-t1"))
    choices = f"abe07, {own}, moskalev24, moskalev24-compensated, root-assist"
    with pytest.raises(ConfigError, match=f"lip-mpc.*choices: {choices}"):
        momentum_qp_config("lip-mpc")


def test_every_kind_is_packaged():
    """Each kind but those from outside has a file; `qp: momentum-qp` stands for its gains."""
    found = {controller_config(name).kind for name in packaged("controllers")}
    assert found | {"outside", "policy-file"} == set(kinds())
    assert controller_config("lqr-lip").qp == controller_config("momentum-qp")
