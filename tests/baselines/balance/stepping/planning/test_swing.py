"""The swing foot: C² everywhere, over its clearance, down at its foothold in time."""

import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.config import SwingTask
from poise.baselines.balance.stepping.planning.swing import FROZEN, quintic, swing_at, time_left
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.maths.vectors import rotation_error
from poise.envs.physics.simulation import Simulation
from tests.support import planned
from tests.support import stepping_reference as readable
from tests.support.shared import generic_state, robot
from tests.support.tasks import swing_rows

DT, HEIGHT = 0.004, 0.8
UNITS = Units(60.0, 9.81, HEIGHT)


def way(moves=(), duration=0.3, after=0.05):
    """(n, 3, 3) reference of a step of 0.4 m; `moves` are (time, foothold, duration)."""
    swing = swing_at(np.array([0.1, 0.2, 0.0]), duration, SwingTask(), UNITS)
    planned.aim(swing, np.array([0.5, 0.2]))
    rows, moves = [swing.reference.copy()], list(moves)
    while swing.time < swing.duration + after:
        if moves and swing.time >= moves[0][0]:
            planned.aim(swing, *moves.pop(0)[1:])
        rows.append(planned.advance(swing, DT))
    return np.array(rows), swing


def generic_ends(seed):
    """Position, velocity and acceleration at 0 and at T."""
    return np.random.default_rng(seed).normal(size=(2, 3))


def test_the_landing_speed_goes_by_the_gravity_of_the_robot():
    """Its unit is h ω: a quarter of the gravity halves it."""
    here, moon = (
        swing_at(np.zeros(3), 0.3, SwingTask(), Units(60.0, gravity, HEIGHT)).landing_speed
        for gravity in (9.81, 0.25 * 9.81)
    )
    assert here == pytest.approx(SwingTask().landing_speed * np.sqrt(9.81 * HEIGHT))
    assert moon == pytest.approx(0.5 * here)


def test_quintic_meets_both_ends():
    """Position, velocity and acceleration at 0 and T are those asked for."""
    start, end = generic_ends(0)
    np.testing.assert_allclose(quintic(*start, *end, 0.7, 0.0), start, atol=1e-9)
    np.testing.assert_allclose(quintic(*start, *end, 0.7, 0.7), end, atol=1e-9)


def test_quintic_is_its_own_derivative():
    """Velocity and acceleration are the derivatives of position and velocity."""
    start, end = generic_ends(1)
    step = 1e-6
    low, high, now = (np.array(quintic(*start, *end, 0.7, 0.3 + s)) for s in (-step, step, 0.0))
    np.testing.assert_allclose((high[:2] - low[:2]) / (2 * step), now[1:], rtol=1e-6, atol=1e-6)


def test_the_way_is_that_of_the_readable_form():
    """Every tick's reference follows from the last one: to the apex, down, and on."""
    swing = swing_at(np.array([0.1, 0.2, 0.01]), 0.3, SwingTask(), UNITS)
    planned.aim(swing, np.array([0.5, 0.1]))
    while swing.time < 0.34:
        expected = readable.advanced(swing, DT)
        np.testing.assert_allclose(planned.advance(swing, DT), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("moves", [(), ((0.1, np.array([0.45, 0.3]), 0.35),)])
def test_reference_is_twice_continuously_differentiable(moves):
    """Between ticks no value jumps, over lift-off, apex, a moved foothold and touchdown alike."""
    rows, _ = way(moves)
    position, velocity, acceleration = rows[:, 0], rows[:, 1], rows[:, 2]
    middle = 0.5 * (velocity[1:] + velocity[:-1])
    error = np.abs(position[1:] - position[:-1] - DT * middle).max()
    assert error < 1e-3  # a jump of position would be centimetres
    middle = 0.5 * (acceleration[1:] + acceleration[:-1])
    assert np.abs(velocity[1:] - velocity[:-1] - DT * middle).max() < 0.05
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.2 * np.abs(acceleration).max()


def test_foot_clears_the_ground_and_lands_where_it_should():
    """The apex is the clearance; at the planned time it is down on the last foothold."""
    moved = np.array([0.45, 0.3])
    rows, swing = way(((0.1, moved, 0.35),), after=0.0)
    assert rows[:, 0, 2].max() == pytest.approx(SwingTask().clearance * HEIGHT, rel=0.05)
    assert swing.time == pytest.approx(0.35, abs=1.5 * DT)
    np.testing.assert_allclose(rows[-1, 0, :2], moved, atol=1e-6)
    assert abs(rows[-1, 0, 2]) < 0.01 and rows[-1, 1, 2] < 0.0


def test_late_ground_is_sought_at_the_landing_speed():
    """After the planned touchdown the foot goes on down, and only down."""
    rows, swing = way(after=0.1)
    late = rows[-10:]
    np.testing.assert_allclose(late[:, 1], [[0.0, 0.0, -swing.landing_speed]] * 10, atol=1e-9)


def test_foothold_is_fixed_shortly_before_touchdown():
    """In the last 30 ms another foothold changes nothing."""
    swing = swing_at(np.zeros(3), 0.2, SwingTask(), UNITS)
    planned.aim(swing, np.array([0.3, 0.0]))
    while time_left(swing) > FROZEN:
        planned.advance(swing, DT)
    planned.aim(swing, np.array([0.6, 0.0]))
    assert swing.foothold[0] == 0.3


def test_rows_ask_for_the_acceleration_of_the_sole():
    """On the reference, at rest in it: J v̇ + J̇ v = a_ref, and no turn."""
    state = generic_state().state
    reference = np.array([state.sole_points[1], state.J_v[6:9], [1.0, 2.0, 3.0]])
    axes = state.sole_axes[1]
    rows = swing_rows(state, 1, reference, axes, SwingTask(damping_ratio=0.0))
    wanted = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(rows.b + state.Jdot_v[6:12], wanted, atol=1e-12)
    np.testing.assert_array_equal(rows.A, state.J[6:12])


def test_rows_turn_the_sole_back():
    """A sole that is turned by a small angle about an axis is asked to turn against it."""
    state = Simulation(robot()).state
    angle = 0.01
    c, s = np.cos(angle), np.sin(angle)
    wanted = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]) @ state.sole_axes[0]
    reference = np.array([state.sole_points[0], np.zeros(3), np.zeros(3)])
    task = SwingTask()
    rows = swing_rows(state, 0, reference, wanted, task)
    k = task.stiffness * state.robot.gravity / state.robot.height_com
    np.testing.assert_allclose(rows.b[3:], [k * angle, 0.0, 0.0], rtol=1e-3, atol=1e-6)


def test_rows_are_those_of_the_readable_form():
    """Matrix, right side and weights at generic points, for either sole."""
    rng = np.random.default_rng(4)
    for sole in range(2):
        state = generic_state(seed=sole).state
        reference, axes = rng.normal(size=(3, 3)), np.linalg.qr(rng.normal(size=(3, 3)))[0]
        task = SwingTask(weight=3.0, turn_weight=2.0, yaw_fraction=0.4, damping_ratio=0.7)
        found = swing_rows(state, sole, reference, axes, task)
        for part, expected in zip(
            found, readable.swing_rows(state, sole, reference, axes, task), strict=True
        ):
            np.testing.assert_allclose(part, expected, rtol=1e-12, atol=1e-9)


def test_a_smaller_share_lets_the_sole_turn_about_the_vertical_only():
    """`yaw_fraction` scales the sixth weight; all else stays."""
    state = generic_state().state
    reference, axes = np.zeros((3, 3)), state.sole_axes[0]
    tasks = SwingTask(), SwingTask(yaw_fraction=0.3)
    whole, part = (swing_rows(state, 0, reference, axes, task) for task in tasks)
    np.testing.assert_allclose(part.weights / whole.weights, [1.0] * 5 + [0.3], rtol=1e-14)
    np.testing.assert_array_equal(part.b, whole.b)


def test_rotation_error_is_the_mean_cross_product():
    """½ Σ aᵢ × bᵢ of the columns; for a turn by an angle about an axis, sin(angle) · axis."""
    rng, found = np.random.default_rng(3), np.zeros(3)
    a, b = rng.normal(size=(2, 3, 3))
    rotation_error(a, b, found)
    np.testing.assert_allclose(found, readable.rotation_error(a, b), atol=1e-12)
    turned = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    rotation_error(np.eye(3), turned, found)
    np.testing.assert_allclose(found, [0.0, 0.0, 0.6], atol=1e-12)
