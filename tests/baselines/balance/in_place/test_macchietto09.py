"""baselines/balance/in_place/macchietto09.py."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.in_place.macchietto09 import Macchietto09
from poise.baselines.controller import Targets
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.whole_body.momentum_qp import MomentumQP
from tests.support.shared import generic_state, robot


def test_without_binding_limits_it_is_the_momentum_qp() -> None:
    """At rest no motor is near its limit: the torques are those of the QP without their cost."""
    config = controller_config("macchietto09").qp
    simulation = generic_state()
    simulation.reset()
    targets = Targets.standing(robot(), simulation.state)
    plain = MomentumQP(robot(), replace(config, torque=replace(config.torque, weight=0.0)))
    macchietto = load_controller("macchietto09", robot())
    assert isinstance(macchietto, Macchietto09)
    expected = plain.torques(simulation.state, targets)
    assert np.max(np.abs(expected) / robot().torque_limit) < 0.99
    assert macchietto.torques(simulation.state, targets) == pytest.approx(expected, abs=1e-4)


def test_beyond_the_limits_the_demand_is_clipped_not_replanned() -> None:
    """The QP gets what it wants by more than the motors have; only the output is within."""
    simulation = generic_state(seed=2)
    state, targets = simulation.state, Targets.standing(robot(), simulation.state)
    macchietto = Macchietto09(robot(), controller_config("macchietto09"))
    torques = macchietto.torques(state, targets)
    limit = robot().torque_limit
    assert np.all(np.abs(torques) <= limit)
    qp = macchietto.qp
    wanted = state.M @ qp.vdot + state.h - state.J.T @ qp.wrenches
    assert wanted[:6] == pytest.approx(np.zeros(6), abs=1e-6)  # hard root
    asked = wanted[robot().motor_dofs]
    assert np.max(np.abs(asked) / limit) > 1.05
    assert torques == pytest.approx(np.clip(asked, -limit, limit), abs=1e-6)
