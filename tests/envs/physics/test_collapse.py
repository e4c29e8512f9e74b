"""envs/physics/collapse.py: a robot that nobody controls any more goes down quietly."""

from __future__ import annotations

import numpy as np
import pytest

from poise.envs.physics.collapse import DURATION, Collapse
from poise.envs.physics.simulation import Simulation
from tests.support.shared import robot


@pytest.mark.parametrize("name", ["humanoid", "compact"])
def test_it_lies_on_the_ground(name: str) -> None:
    """After a push that fells it, nearly at rest; its motors have taken energy, none gave any."""
    simulation = Simulation(robot(name))
    simulation.data.qvel[0] = 1.0  # [m/s] ahead
    collapse, dt = Collapse(simulation), simulation.arrays.timestep
    start, most = float(simulation.state.com[2]), 0.0
    for _ in range(round(DURATION / dt)):
        speed = simulation.data.qvel[collapse._dofs].copy()
        collapse.step(1)
        most = max(most, float((simulation.views.ctrl * speed).max()))
        assert np.all(np.abs(simulation.views.ctrl) <= robot(name).torque_limit + 1e-12)
    assert most <= 0.0
    assert simulation.state.com[2] - simulation.arrays.floor < 0.35 * start
    assert np.abs(simulation.data.qvel[collapse._dofs]).max() < 3.0
    assert np.isfinite(simulation.data.qpos).all()
