"""Contacts in the standing posture: of bodies with each other, of soles with the ground."""

from dataclasses import dataclass

import mujoco

from poise.envs.physics.legs import standing_data
from poise.envs.robots.robot import Robot

MESH = int(mujoco.mjtGeom.mjGEOM_MESH)


@dataclass(frozen=True)
class SelfContact:
    """Two bodies of the robot that collide while it stands.

    Attributes:
        bodies: their names.
        depth: how deep one is inside the other, where it is deepest [m].
        meshes: whether either shape is a mesh, of which MuJoCo collides the convex hull.
    """

    bodies: tuple[str, str]
    depth: float
    meshes: bool


def self_contacts(robot: Robot) -> tuple[SelfContact, ...]:
    """One for each pair of bodies, the deepest first."""
    model, data = robot.model, standing_data(robot)
    found: dict[tuple[str, str], SelfContact] = {}
    for i in range(data.ncon):
        contact = data.contact[i]
        geoms = (contact.geom1, contact.geom2)
        if robot.ground_geom_id in geoms or contact.dist >= 0.0:
            continue
        first, second = (model.body(model.geom_bodyid[g]).name for g in geoms)
        meshes = any(model.geom_type[g] == MESH for g in geoms)
        new = SelfContact((first, second), -float(contact.dist), meshes)
        old = found.get(new.bodies)
        if old is None or new.depth > old.depth:
            found[new.bodies] = new
    return tuple(sorted(found.values(), key=lambda each: -each.depth))


def sole_contacts(robot: Robot) -> dict[str, int]:
    """Foot → at how many points MuJoCo lets its sole touch the ground."""
    data, ground = standing_data(robot), robot.ground_geom_id
    pairs = [{data.contact[i].geom1, data.contact[i].geom2} for i in range(data.ncon)]
    return {
        sole.name: sum(ground in pair and bool(pair & set(sole.geom_ids)) for pair in pairs)
        for sole in robot.soles
    }
