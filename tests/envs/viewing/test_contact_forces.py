"""envs/viewing/contact_forces.py: what the ground does to each body that touches it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from poise.envs.physics.simulation import Simulation
from poise.envs.viewing.contact_forces import GAIN, ContactForces
from poise.envs.viewing.quantities import CONTACT_FORCE
from tests.support.shared import robot


@pytest.fixture
def simulation() -> Simulation:
    """A robot that sinks down, pushed to its left."""
    simulation = Simulation(robot())
    simulation.step(np.zeros(simulation.model.nu), 30)
    return simulation


def test_the_forces_are_those_on_the_whole_robot(simulation: Simulation) -> None:
    """Their sum is what MuJoCo's constraints put on the free root, at the same moment."""
    found = ContactForces(simulation).find()
    assert set(found) == {sole.body_id for sole in robot().soles}
    other = mujoco.MjData(simulation.model)
    for name in ("qpos", "qvel", "ctrl", "qacc_warmstart"):
        getattr(other, name)[:] = getattr(simulation.data, name)
    mujoco.mj_forward(simulation.model, other)
    total = sum(force for force, _ in found.values())
    assert np.allclose(total, other.qfrc_constraint[:3], rtol=1e-6, atol=1e-6)
    assert total[2] > 100.0
    for body, (_, point) in found.items():
        assert abs(point[2]) < 0.01
        assert np.linalg.norm(point[:2] - simulation.data.xpos[body][:2]) < 0.2


def test_they_only_read(simulation: Simulation) -> None:
    """The robot moves on by the same bits."""
    other = Simulation(robot())
    other.step(np.zeros(other.model.nu), 30)
    forces = ContactForces(simulation)
    for _ in range(5):
        forces.marks()
        simulation.step(np.zeros(simulation.model.nu))
        other.step(np.zeros(other.model.nu))
    assert np.array_equal(simulation.data.qpos, other.data.qpos)
    assert np.array_equal(simulation.data.qvel, other.data.qvel)


def test_an_arrow_for_each_foot(simulation: Simulation) -> None:
    """As long as the force is large; none in the air."""
    forces = ContactForces(simulation)
    found, arrows = forces.find(), forces.marks()
    weight = robot().mass * simulation.arrays.gravity
    assert len(arrows) == len(found)
    for (force, point), arrow in zip(found.values(), arrows, strict=True):
        assert np.array_equal(arrow.start, point) and arrow.colour == CONTACT_FORCE.colour
        expected = GAIN * robot().height_com * force / weight
        assert np.allclose(arrow.end - arrow.start, expected)
    qpos = robot().standing_qpos.copy()
    qpos[2] += 0.5
    simulation.reset(qpos)
    assert forces.marks() == []
