"""What is drawn over a simulation, and where."""

import mujoco
import numpy as np
import pytest

from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot
from poise.envs.viewing.overlays import FADE, draw, marks, push_arrows

PUSH = Push("torso", start=0.02, duration=0.1, impulse=10.0, direction=90.0, point=(0.1, 0.0, 0.2))


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


@pytest.fixture
def simulation(robot):
    return Simulation(robot)


def named(found, name):
    return [mark for mark in found if mark.name == name]


def run(simulation, seconds):
    simulation.step(np.zeros(simulation.model.nu), round(seconds / simulation.model.opt.timestep))


def test_marks_are_where_the_state_says(simulation):
    """CoM, its projection, CoP, capture point and polygon have the state's own coordinates."""
    run(simulation, 0.1)
    state, found = simulation.state, marks(simulation)
    for name, expected in [
        ("com", state.com),
        ("com on ground", [*state.com[:2], 0.0]),
        ("cop", [*state.cop, 0.0]),
        ("capture point", [*state.capture_point, 0.0]),
    ]:
        (mark,) = named(found, name)
        assert np.array_equal(mark.start, expected), name
    edges = named(found, "support")
    assert np.array_equal([edge.start[:2] for edge in edges], state.support_polygon)
    assert np.array_equal([edge.end for edge in edges], np.roll([e.start for e in edges], -1, 0))


def test_marks_only_read(simulation):
    """No array of the state changes, not even one that is computed on demand."""
    run(simulation, 0.1)
    before = [array.tobytes() for array in simulation.state_arrays.members()]
    marks(simulation)
    assert [array.tobytes() for array in simulation.state_arrays.members()] == before


def test_no_centre_of_pressure_in_the_air(simulation, robot):
    """A robot that flies has no CoP mark."""
    run(simulation, 0.02)
    assert named(marks(simulation), "cop")
    qpos = robot.standing_qpos.copy()
    qpos[2] += 1.0
    simulation.reset(qpos)
    assert not named(marks(simulation), "cop")


def test_arrow_ends_at_the_point_of_application_along_the_force(simulation):
    """Its tip is the pushed point of the moving body, its direction the force's."""
    simulation.set_pushes([PUSH])
    run(simulation, 0.08)
    (arrow,) = push_arrows(simulation)
    body, data = simulation.model.body("torso").id, simulation.data
    expected = data.xipos[body] + data.xmat[body].reshape(3, 3) @ PUSH.point
    assert np.allclose(arrow.end, expected, atol=1e-12)
    direction = (arrow.end - arrow.start) / np.linalg.norm(arrow.end - arrow.start)
    assert np.allclose(direction, [0.0, 1.0, 0.0], atol=1e-9)


def test_arrow_follows_the_heading_at_the_reset(simulation, robot):
    """A push to the left of a robot that faces +y points along −x."""
    qpos = robot.standing_qpos.copy()
    qpos[3:7] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    simulation.reset(qpos, pushes=[Push("torso", 0.0, 0.1, 10.0, 90.0)])
    (arrow,) = push_arrows(simulation)
    direction = (arrow.end - arrow.start) / np.linalg.norm(arrow.end - arrow.start)
    assert np.allclose(direction, [-1.0, 0.0, 0.0], atol=1e-6)


def test_arrow_is_there_while_the_push_acts_and_then_fades(simulation):
    """Not before; opaque from start to end; then thinner until it is gone."""
    simulation.set_pushes([PUSH])
    opacity = {}
    for _ in range(31):
        arrows = push_arrows(simulation)
        opacity[round(simulation.time, 3)] = arrows[0].opacity if arrows else 0.0
        run(simulation, 0.02)
    end = PUSH.start + PUSH.duration
    for t, value in opacity.items():
        expected = np.clip(1.0 - (t - end) / FADE, 0.0, 1.0) if t >= PUSH.start else 0.0
        assert value == pytest.approx(expected, abs=1e-9), t


def test_arrow_grows_with_the_force(simulation):
    """Twice the force is twice the length, between a shortest and a longest arrow."""
    lengths = []
    for impulse in (0.1, 12.0, 24.0, 500.0):
        simulation.reset(pushes=[Push("torso", 0.0, 0.1, impulse, 0.0)])
        (arrow,) = push_arrows(simulation)
        lengths.append(np.linalg.norm(arrow.end - arrow.start))
    assert lengths[0] > 0.2
    assert lengths[2] == pytest.approx(2.0 * lengths[1])
    assert lengths[2] < lengths[3] < 1.5


def test_two_pushes_and_a_kick_are_three_arrows(simulation):
    """Every push of the schedule has its own arrow; no force, no arrow."""
    pushes = [PUSH, Push("pelvis", 0.0, 0.1, 5.0, 0.0), Kick(0.02, 0.3, 180.0)]
    simulation.set_pushes([*pushes, Push("torso", 0.0, 0.5, 0.0, 0.0)])
    run(simulation, 0.04)
    arrows = push_arrows(simulation)
    assert len(arrows) == 3
    assert arrows[2].end[0] < arrows[2].start[0]  # the kick goes backward


def test_draw_stops_where_the_scene_is_full(simulation):
    """Marks are appended in order, as far as there is room."""
    found = marks(simulation)
    scene = mujoco.MjvScene(simulation.model, len(found) - 2)
    draw(scene, found)
    assert scene.ngeom == len(found) - 2
    assert scene.geoms[0].type == int(mujoco.mjtGeom.mjGEOM_CAPSULE)
    assert np.allclose(scene.geoms[0].pos, (found[0].start + found[0].end) / 2, atol=1e-6)
