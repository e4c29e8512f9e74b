"""The wrench cone against forces at the points of a sole, and its friction against the model."""

import numpy as np
import pytest
from scipy.optimize import linprog

from poise.baselines.whole_body.contacts.wrench_cone import robot_cones, wrench_cone
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.ground import contact_friction
from tests.support.physics import robot_named

MU = 0.8
POLYGONS = {
    "box": np.array([[0.13, -0.04], [0.13, 0.04], [-0.13, 0.04], [-0.13, -0.04]]),
    "skewed": np.array([[0.1, -0.05], [0.14, 0.02], [0.0, 0.05], [-0.1, 0.02], [-0.09, -0.03]]),
}


@pytest.fixture(params=POLYGONS)
def polygon(request):
    return POLYGONS[request.param]


def at(point, force, yaw=0.0):
    """Wrench at the origin of a force at a point of the sole, and a yaw moment."""
    return np.concatenate([force, np.cross([*point, 0.0], force) + [0.0, 0.0, yaw]])


def random_points(rng, polygon, count):
    return rng.dirichlet(np.ones(len(polygon)), count) @ polygon


def test_pressure_anywhere_in_the_polygon_is_inside(polygon):
    """Vertical forces at points of the sole are in the cone, and their sums too."""
    cone = wrench_cone(polygon, MU)
    rng = np.random.default_rng(0)
    wrenches = [at(point, [0, 0, 300.0]) for point in random_points(rng, polygon, 50)]
    assert max((cone @ w).max() for w in wrenches) < 1e-9
    assert (cone @ np.sum(wrenches, axis=0)).max() < 1e-9


def test_pressure_outside_the_polygon_is_outside(polygon):
    """A CoP 1 mm beyond any vertex or edge is refused, one 1 mm inside of it is not."""
    cone, middle = wrench_cone(polygon, MU), polygon.mean(axis=0)
    border = np.concatenate([polygon, 0.5 * (polygon + np.roll(polygon, -1, axis=0))])
    for point in border:
        outward = (point - middle) / np.linalg.norm(point - middle)
        assert (cone @ at(point + 1e-3 * outward, [0, 0, 1.0])).max() > 1e-5
        assert (cone @ at(point - 1e-3 * outward, [0, 0, 1.0])).max() < 0.0


def test_friction(polygon):
    """Tangential forces through the middle are inside while |f_x| + |f_y| is below μ f_z."""
    cone, middle = wrench_cone(polygon, MU), polygon.mean(axis=0)
    for angle in np.linspace(0.0, 2 * np.pi, 17):
        direction = np.array([np.cos(angle), np.sin(angle)])
        reach = MU / np.abs(direction).sum()
        for size, inside in ((0.999 * reach, True), (1.001 * reach, False)):
            wrench = at(middle, [*size * direction, 1.0])
            assert bool((cone @ wrench).max() <= 0.0) is inside


def test_nothing_pulls(polygon):
    """No wrench with f_z < 0 is inside, and no wrench at all is."""
    cone, rng = wrench_cone(polygon, MU), np.random.default_rng(1)
    for _ in range(200):
        wrench = rng.normal(size=6)
        wrench[2] = -abs(wrench[2])
        assert (cone @ wrench).max() > 0.0
    assert (cone @ np.zeros(6)).max() == 0.0


def test_the_cone_is_what_forces_at_the_vertices_can_give(polygon):
    """A wrench is inside if and only if forces at the vertices that do not slide add up to it."""
    cone, rng = wrench_cone(polygon, MU), np.random.default_rng(2)
    edges = [[MU, 0, 1], [-MU, 0, 1], [0, MU, 1], [0, -MU, 1]]
    columns = np.stack([at(vertex, edge) for vertex in polygon for edge in edges], axis=1)
    inside = 0
    for point in random_points(rng, polygon, 60):
        force = np.array([*rng.uniform(-0.6, 0.6, 2) * MU, 1.0])
        wrench = at(point, force, yaw=rng.normal() * 0.08)
        violation = (cone @ wrench).max()
        possible = linprog(np.zeros(columns.shape[1]), A_eq=columns, b_eq=wrench).success
        assert abs(violation) < 1e-9 or (violation < 0.0) == possible
        inside += possible
    assert 10 < inside < 50


def test_a_corner_transmits_no_yaw_moment(polygon):
    """Pressure in the middle leaves room for a yaw moment, pressure at a corner leaves none."""
    cone = wrench_cone(polygon, MU)
    for sign in (-1.0, 1.0):
        assert (cone @ at(polygon.mean(axis=0), [0, 0, 1.0], yaw=sign * 0.02)).max() < 0.0
        for vertex in polygon:
            assert (cone @ at(0.999 * vertex, [0, 0, 1.0], yaw=sign * 0.002)).max() > 0.0


@pytest.mark.parametrize("name", ["humanoid", "tall", "compact", "toddler"])
def test_cones_of_a_robot(name):
    """Shares shrink friction and polygon; all soles have as many rows; padding never binds."""
    robot = robot_named(name)
    cones = robot_cones(robot, 0.5, 0.9)
    assert cones.shape[0] == 2 and cones.shape[1] >= 32
    for cone, sole in zip(cones, robot.soles, strict=True):
        mu = 0.5 * contact_friction(robot.model, robot.ground_geom_id, sole.geom_ids)
        assert (cone @ [0.99 * mu, 0, 1, 0, 0, 0]).max() <= 0.0
        assert (cone @ [1.01 * mu, 0, 1, 0, 0, 0]).max() > 0.0
        for vertex in sole.polygon:
            assert (cone @ at(0.89 * vertex, [0, 0, 1.0])).max() <= 0.0
            assert (cone @ at(0.91 * vertex, [0, 0, 1.0])).max() > 0.0


@pytest.mark.parametrize("name", ["humanoid", "tall", "compact", "toddler"])
def test_friction_is_what_the_simulator_uses(name):
    """The sliding friction of MuJoCo's own contacts between each sole and the ground."""
    robot = robot_named(name)
    simulation = Simulation(robot)
    simulation.step(np.zeros(robot.model.nu), 5)
    for sole in robot.soles:
        used = [
            contact.friction[0]
            for contact in simulation.data.contact
            if set(contact.geom) & set(sole.geom_ids) and robot.ground_geom_id in contact.geom
        ]
        assert used
        np.testing.assert_allclose(
            used, contact_friction(robot.model, robot.ground_geom_id, sole.geom_ids)
        )
