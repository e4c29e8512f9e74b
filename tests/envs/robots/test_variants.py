"""envs/robots/variants.py."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import coarser_robot
from tests.support.shared import robot


def test_longer_physics_steps() -> None:
    """The same robot in steps of another length, which its fingerprint tells."""
    coarse = coarser_robot(robot(), 0.005)
    assert coarse.model.opt.timestep == 0.005 and robot().model.opt.timestep == 0.002
    assert coarse.fingerprint != robot().fingerprint
    assert coarser_robot(robot(), 0.002).fingerprint == robot().fingerprint
    simulation = Simulation(coarse)
    simulation.step(np.zeros(coarse.model.nu), 3)
    assert simulation.time == pytest.approx(0.015)
    for timestep in (0.0, 0.011, np.nan):
        with pytest.raises(ValueError, match="timestep must be"):
            coarser_robot(robot(), timestep)
