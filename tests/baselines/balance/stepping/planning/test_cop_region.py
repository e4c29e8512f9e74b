"""Capture regions of the pendulum, and where soles can put the centre of pressure."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import ConvexHull

from poise.baselines.balance.references.legs import ankle_limits, nominal_feet
from poise.baselines.balance.stepping.planning.cop_region import (
    LOAD_FRACTIONS,
    cop_region,
    rest_ahead,
)
from poise.envs.compiled.maths.pendulum import capture_distance
from poise.envs.compiled.maths.polygons import clipped
from poise.envs.compiled.maths.vectors import turn
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot
from tests.support import planned
from tests.support import stepping_reference as readable
from tests.support.shared import robot
from tests.support.stepping_reference import drifted

OMEGA = 3.5


def test_capture_point_drifts_as_the_pendulum_does():
    """ξ(t) = p + (ξ − p) e^(ωt) for c̈ = ω² (c − p) from any start."""
    p, c, v, t = 0.02, 0.05, 0.3, 0.3
    end = solve_ivp(
        lambda _, y: [y[1], OMEGA**2 * (y[0] - p)], (0.0, t), [c, v], rtol=1e-10, atol=1e-12
    ).y[:, -1]
    xi = drifted(np.array([c + v / OMEGA]), np.array([p]), OMEGA, t)
    assert xi[0] == pytest.approx(end[0] + end[1] / OMEGA, abs=1e-8)


@pytest.mark.parametrize("steps", [0, 1, 2, 5])
def test_capture_distance_is_what_that_many_steps_can_just_stop(steps):
    """From d_N, N steps of length l at time T_s with the CoP always at the reach end at rest."""
    reach, length, time = 0.07, 0.5, 0.35
    xi, foot = capture_distance(steps, reach, length, OMEGA, time), 0.0
    for _ in range(steps):
        xi = drifted(np.array(xi), np.array(foot + reach), OMEGA, time)
        foot += length
    assert xi == pytest.approx(foot + reach, abs=1e-9)


def test_capture_distance_grows_to_its_limit():
    """d_∞ = r + l a / (1 − a) [Koolen12]."""
    a = np.exp(-OMEGA * 0.35)
    assert capture_distance(60, 0.07, 0.5, OMEGA, 0.35) == pytest.approx(0.07 + 0.5 * a / (1 - a))


def test_clipping_keeps_the_half_plane():
    """A square cut by x ≤ 0.2 has its corners there; one wholly outside leaves its nearest."""
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    cut = clipped(square, np.array([1.0, 0.0]), 0.2)
    corners = [[-1.0, -1.0], [-1.0, 1.0], [0.2, -1.0], [0.2, 1.0]]
    np.testing.assert_allclose(sorted(cut.round(9).tolist()), corners)
    assert clipped(square, np.array([1.0, 0.0]), -3.0)[0, 0] == -1.0


def test_ankle_limits_are_the_torques_of_a_vertical_force():
    """N p − o is the ankle's torque over m g for a force m g at p of the sole: −Jᵀ f there."""
    simulation = Simulation(robot())
    state, weight = simulation.state, robot().mass * simulation.arrays.gravity
    rng = np.random.default_rng(0)
    for i, sole in enumerate(robot().soles):
        normal, offset, bound = ankle_limits(robot(), i)
        joints = [d for d in robot().motor_dofs if robot().model.dof_bodyid[d] == sole.body_id]
        assert len(joints) == len(bound) > 0
        for p in rng.uniform(-0.1, 0.1, (5, 2)):
            arm = state.sole_axes[i][:, :2] @ p
            f = np.array([0.0, 0.0, weight])
            wrench = np.concatenate([f, np.cross(arm, f)])
            torque = (state.J[6 * i : 6 * i + 6].T @ wrench)[joints]
            np.testing.assert_allclose(weight * (normal @ p - offset), torque, atol=1e-6)


def test_reach_of_one_sole_ends_at_its_edge_or_at_its_ankle_torque():
    """Every corner lies in the sole, and within what the ankles hold."""
    region = cop_region(robot(), 1.0)
    for i, sole in enumerate(robot().soles):
        normal, offset, bound = ankle_limits(robot(), i)
        corners = region.alone[i]
        assert np.all(np.abs(corners) <= np.abs(sole.polygon).max(axis=0) + 1e-9)
        assert np.all(np.abs(corners @ normal.T - offset) <= bound + 1e-9)
        assert np.ptp(corners, axis=0).min() > 0.02


def test_two_soles_reach_further_than_one():
    """Each sole's own reach is inside; in the middle the ankles share the load and reach more."""
    region, feet = cop_region(robot()), np.array([[0.0, 0.09], [0.0, -0.09]])
    for i in range(2):
        own = planned.alone(region, i, feet[i], 0.0)
        assert np.all(planned.beyond(region, feet[0], feet[1], 0.0, own) < 1e-9)
    ahead = region.alone[0][:, 0].max()
    assert region.both(feet, 0.0)[:, 0].max() > ahead + 0.02


def test_distance_beyond_the_reach_agrees_with_its_hull():
    """`beyond` is zero on the hull's corners, whatever the feet and the yaw."""
    region, rng = cop_region(robot()), np.random.default_rng(1)
    for _ in range(5):
        yaw = rng.uniform(-3, 3)
        feet = rng.uniform(-0.2, 0.2, (2, 2)) + np.array([[0.0, 0.2], [0.0, -0.2]])
        feet = feet @ turn(yaw).T
        corners = region.both(feet, yaw)
        gaps = planned.beyond(region, feet[0], feet[1], yaw, corners)
        assert np.all(gaps < 1e-9) and np.all(gaps > -0.01)
        far = feet.mean(axis=0) + np.array([5.0, 0.0])
        assert planned.beyond(region, feet[0], feet[1], yaw, far) > 3.0


def generic_feet(rng):
    """Two soles somewhere, and their yaw."""
    yaw = rng.uniform(-3, 3)
    feet = rng.uniform(-0.2, 0.2, (2, 2)) + np.array([[0.0, 0.2], [0.0, -0.2]])
    return feet @ turn(yaw).T + rng.normal(size=2), yaw


def both_soles(region, feet, yaw):
    """Points that two soles reach under all fractions of the load (n, 2)."""
    return np.vstack([
        load * feet[0] + (1.0 - load) * feet[1] + sums @ turn(yaw).T
        for load, sums in zip(LOAD_FRACTIONS, region.sums, strict=True)
    ])  # fmt: skip


def test_reach_of_two_soles_is_the_hull_of_all_loads():
    """The corners that Qhull finds, no others: their mean is where the robot comes to rest."""
    region, rng = cop_region(robot()), np.random.default_rng(5)
    for _ in range(20):
        feet, yaw = generic_feet(rng)
        cloud = both_soles(region, feet, yaw)
        expected = cloud[ConvexHull(cloud).vertices]
        corners = region.both(feet, yaw)
        order, other = np.lexsort(corners.T.round(9)), np.lexsort(expected.T.round(9))
        np.testing.assert_allclose(corners[order], expected[other], atol=1e-9)
        edges = np.roll(corners, -1, axis=0) - corners
        ahead = np.roll(edges, -1, axis=0)
        assert np.all(edges[:, 0] * ahead[:, 1] - edges[:, 1] * ahead[:, 0] > 0.0)


@pytest.mark.parametrize("name", ["humanoid", "compact"])
def test_reach_of_two_soles_along_the_axes(name):
    """Feet that face along x: points of one upright edge differ in x by rounding."""
    region, rng = cop_region(load_robot(name)), np.random.default_rng(7)
    for _ in range(20):
        feet = rng.uniform(-0.2, 0.2, (2, 2)) + np.array([[0.0, 0.2], [0.0, -0.2]])
        feet[1, 0] = feet[0, 0] + rng.uniform(-1e-15, 1e-15)
        expected = ConvexHull(both_soles(region, feet, 0.0))
        corners = region.both(feet, 0.0)
        found = ConvexHull(corners)
        assert len(found.vertices) == len(corners)
        assert found.volume == pytest.approx(expected.volume, rel=1e-9)  # in the plane, the area


def test_distance_beyond_the_reach_is_that_of_the_readable_form():
    """At generic points, within and outside."""
    region, rng = cop_region(robot()), np.random.default_rng(6)
    for _ in range(20):
        feet, yaw = generic_feet(rng)
        xi = feet.mean(axis=0) + rng.uniform(-0.3, 0.3, 2)
        found = planned.beyond(region, feet[0], feet[1], yaw, xi)
        assert found == pytest.approx(readable.beyond(region, *feet, yaw, xi), abs=1e-9)


def test_steps_end_where_the_posture_has_the_centre_of_mass():
    """In the nominal stance the middle of the region and `rest_ahead` make the CoM's place."""
    toddler = cop_region(robot("toddler"))
    middle = toddler.both(nominal_feet(robot("toddler")), 0.0).mean(axis=0)[0]
    assert middle + rest_ahead(robot("toddler"), toddler) == pytest.approx(
        robot("toddler").com_ahead
    )
    assert abs(rest_ahead(robot("toddler"), toddler)) > 0.01
    assert rest_ahead(robot(), cop_region(robot())) == 0.0  # its gains say where
