"""envs/robots/variants.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.envs.physics.simulation import Simulation
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.robots.variants import coarser_robot, perturbed_robot
from tests.support.shared import robot
from tests.support.small_biped import BOX_FOOT, motors, write_biped


def test_masses_and_what_follows_from_them_are_scaled() -> None:
    """Mass, inertia matrix and bias forces of the same state all grow by a tenth."""
    heavy = perturbed_robot(robot(), mass_error=0.1)
    assert heavy.mass == pytest.approx(1.1 * robot().mass)
    one, other = Simulation(robot()).state, Simulation(heavy).state
    armature = np.diag(robot().model.dof_armature)
    assert other.M - armature == pytest.approx(1.1 * (one.M - armature), abs=1e-9)
    assert other.com == pytest.approx(one.com)
    assert heavy.model.body_subtreemass[0] == pytest.approx(1.1 * robot().mass)


def test_the_given_robot_stays_as_it_was() -> None:
    """The altered robot has its own model, and another fingerprint."""
    before = robot().model.geom_friction.copy(), robot().model.body_mass.copy()
    other = perturbed_robot(robot(), friction=0.4, mass_error=-0.1)
    assert np.array_equal(robot().model.geom_friction, before[0])
    assert np.array_equal(robot().model.body_mass, before[1])
    assert other.fingerprint != robot().fingerprint
    assert perturbed_robot(robot()).fingerprint == robot().fingerprint


def friction(robot: Robot) -> float:
    """Of the first sole on the ground."""
    return contact_friction(robot.model, robot.ground_geom_id, robot.soles[0].geom_ids)


def test_friction_is_what_the_soles_meet() -> None:
    """A robot pushed sideways at its root slides where the floor does not hold it."""
    assert friction(robot()) == pytest.approx(0.8)
    smooth = perturbed_robot(robot(), friction=0.05)
    assert friction(smooth) == pytest.approx(0.05)
    moved = []
    for one in (robot(), smooth):
        simulation = Simulation(one)
        qvel = np.zeros(one.model.nv)
        qvel[1] = 0.4
        simulation.reset(qvel=qvel)
        start = simulation.state.origin.copy()
        simulation.step(np.zeros(one.model.nu), 50)
        moved.append(float(np.linalg.norm(simulation.state.origin[:2] - start[:2])))
    assert moved[1] > 3 * moved[0]


def test_contact_pairs_take_the_friction(tmp_path: Path) -> None:
    """Soles that meet the ground only as explicit pairs have the altered friction in contacts."""
    foot = BOX_FOOT.replace("/>", ' contype="0" conaffinity="0"/>')
    pairs = "".join(f'<pair geom1="{s}_sole" geom2="floor"/>' for s in ("left", "right"))
    path = write_biped(
        tmp_path,
        foot=foot,
        extra=motors(ctrlrange="-9 9") + f"<contact>{pairs}</contact>",
        world='<geom name="floor" type="plane" size="1 1 1"/>',
        options={"friction": 0.6},
    )
    smooth = perturbed_robot(load_robot(path), friction=0.05)
    assert friction(load_robot(path)) == 0.6 and friction(smooth) == 0.05
    simulation = Simulation(smooth)
    simulation.step(np.zeros(smooth.model.nu), 5)
    contacts = [contact.friction[:2].tolist() for contact in simulation.data.contact]
    assert contacts and all(found == [0.05, 0.05] for found in contacts)


@pytest.mark.parametrize("change", [{"friction": 0.0}, {"mass_error": -1.0}])
def test_what_cannot_be_is_refused(change: dict[str, float]) -> None:
    """No friction at all, or no mass."""
    with pytest.raises(ValueError, match=next(iter(change))):
        perturbed_robot(robot(), **change)


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
