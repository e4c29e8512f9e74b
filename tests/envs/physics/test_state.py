"""What a state says about balance: capture point, support, heading, contacts."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from poise.baselines.controller import Targets
from poise.envs.physics.simulation import Simulation
from tests.support.physics import controller, forward, push, robot_named

ROBOTS = ("humanoid", "tall")  # tall: a root that does not face along its x axis


@pytest.fixture(scope="module")
def pushed():
    """A humanoid in the middle of a push, with the contact forces of this very instant."""
    robot = robot_named("humanoid")
    simulation = Simulation(robot)
    qp = controller(robot)
    state = simulation.reset(pushes=[push(robot, 0.3, 70.0)])
    targets = Targets.standing(robot, state)
    for _ in range(25):  # 0.1 s, so 0.02 s before the push ends
        state = simulation.step(qp.torques(state, targets), 2)
    assert np.abs(simulation.data.xfrc_applied).max() > 50.0
    forward(simulation)
    return simulation


def test_capture_point_and_omega(pushed):
    """ξ = c + ċ/ω with ω = √(g/z_c)."""
    state = pushed.state
    height = state.com[2] - np.mean(state.sole_points[:, 2])
    assert state.omega == pytest.approx(np.sqrt(9.81 / height), rel=1e-12)
    np.testing.assert_allclose(
        state.capture_point, (state.com + state.com_vel / state.omega)[:2], atol=1e-12
    )
    assert np.linalg.norm(state.capture_point - state.com[:2]) > 0.02
    # a pendulum c̈ = ω² (c − ξ) that starts there comes to rest over ξ, by 1/e in every 1/ω
    gap, speed = state.com[:2] - state.capture_point, state.com_vel[:2] / state.omega
    later = gap * np.cosh(4.0) + speed * np.sinh(4.0)
    np.testing.assert_allclose(later, np.exp(-4.0) * gap, atol=1e-12)


def test_support_polygon_is_the_hull_of_the_soles(pushed):
    """The polygon is SciPy's convex hull of all soles' vertices, counter-clockwise."""
    state = pushed.state
    points = [
        (point + sole.polygon @ axes[:, :2].T)[:, :2]
        for point, axes, sole in zip(
            state.sole_points, state.sole_axes, pushed.robot.soles, strict=True
        )
    ]
    hull = ConvexHull(np.concatenate(points))
    polygon = state.support_polygon
    assert ConvexHull(polygon).volume == pytest.approx(hull.volume, rel=1e-9)
    for vertex in hull.points[hull.vertices]:
        assert np.linalg.norm(polygon - vertex, axis=1).min() < 1e-6 or len(polygon) < len(
            hull.vertices
        )
    following = np.roll(polygon, -1, axis=0)
    area = 0.5 * np.sum(polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0])
    assert area == pytest.approx(hull.volume, rel=1e-9)
    inside = polygon.mean(axis=0)
    gap = -(hull.equations[:, :2] @ inside + hull.equations[:, 2]).max()
    assert state.support_distance(inside) == pytest.approx(gap, abs=1e-6)
    assert state.support_distance(inside + [1.0, 0.0]) < -0.5


def test_a_foot_in_the_air_bears_nothing():
    """A sole 5 cm above the other one is no part of the polygon; one 5 mm above it still is."""
    robot = robot_named("humanoid")
    simulation, hips = Simulation(robot), robot.joint_names.index("left_hip_y")
    areas = []
    for bend in (0.0, 0.06, 0.6):  # hip and knee, so that the left sole rises
        qpos = robot.standing_qpos.copy()
        qpos[7 + hips] -= bend
        qpos[7 + robot.joint_names.index("left_knee")] -= bend
        state = simulation.reset(qpos)
        areas.append(ConvexHull(state.support_polygon).volume)
        rise = state.sole_points[0, 2] - state.sole_points[1, 2]
    assert rise > 0.05
    assert areas[1] > 0.9 * areas[0]
    assert areas[2] == pytest.approx(ConvexHull(robot.soles[1].polygon).volume, rel=1e-6)
    assert state.support_distance(state.sole_points[0, :2]) < 0.0


@pytest.mark.parametrize("direction", [0.0, 33.0, 90.0, 180.0, 271.0])
def test_support_margin_reaches_the_edge(pushed, direction):
    """From the CoM's projection, δ(θ) along θ leads exactly to the edge of the polygon."""
    state = pushed.state
    margin = state.support_margin(direction)
    angle = np.radians(direction) + state.heading_yaw
    edge = state.com[:2] + margin * np.array([np.cos(angle), np.sin(angle)])
    assert margin > 0.01
    assert state.support_distance(edge) == pytest.approx(0.0, abs=1e-9)


def test_no_margin_outside_the_support():
    """Where the CoM's projection is outside, there is no margin in any direction."""
    robot = robot_named("humanoid")
    simulation = Simulation(robot)
    qpos = robot.standing_qpos.copy()
    lean = Rotation.from_euler("y", 0.6) * Rotation.from_quat(qpos[3:7], scalar_first=True)
    qpos[3:7] = lean.as_quat(scalar_first=True)
    qpos[0] += 0.3
    qpos[2] += 0.5
    state = simulation.reset(qpos)
    assert state.support_distance(state.com[:2]) < 0.0
    assert [state.support_margin(d) for d in (0.0, 90.0, 180.0)] == [0.0, 0.0, 0.0]


def test_heading_turns_with_the_feet():
    """The heading frame's yaw is that of the soles and its origin is between them."""
    robot = robot_named("tall")
    qpos = robot.standing_qpos.copy()
    turn = Rotation.from_euler("z", 2.0)
    qpos[:3] = turn.apply(qpos[:3]) + [1.0, -2.0, 0.0]
    root = turn * Rotation.from_quat(qpos[3:7], scalar_first=True)
    qpos[3:7] = root.as_quat(scalar_first=True)
    state = Simulation(robot).reset(qpos)
    assert state.heading_yaw == pytest.approx(2.0, abs=1e-6)
    np.testing.assert_allclose(state.origin, [1.0, -2.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(state.heading, [np.cos(2.0), np.sin(2.0)], atol=1e-6)


def test_contacts_tell_feet_from_the_rest():
    """Standing, both feet touch and nothing else; in the air nothing; lying, something else."""
    robot = robot_named("humanoid")
    simulation = Simulation(robot)
    assert simulation.state.contacts.tolist() == [1.0, 1.0] and not simulation.state.other_contact
    qpos = robot.standing_qpos.copy()
    qpos[2] += 0.5
    state = simulation.reset(qpos)
    assert state.contacts.tolist() == [0.0, 0.0] and not state.other_contact
    np.testing.assert_allclose(state.cop, state.origin[:2])  # no force: no CoP
    qpos[2], qpos[3:7] = 0.1, [np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0]
    assert simulation.reset(qpos).other_contact


def test_a_state_is_read_only_and_a_copy_stays():
    """Views cannot be written to; a copy does not change when the simulation moves on."""
    simulation = Simulation(robot_named("humanoid"))
    state, kept = simulation.state, simulation.state.copy()
    with pytest.raises(ValueError, match="read-only"):
        state.com[0] = 1.0
    with pytest.raises(AttributeError, match="com of a state is read-only"):
        state.com = kept.com
    before = kept.com.copy()
    simulation.step(np.zeros(simulation.model.nu), 20)
    np.testing.assert_array_equal(kept.com, before)
    assert np.abs(simulation.state.com - before).max() > 1e-6
