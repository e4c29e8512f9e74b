"""Pictures of a simulation: they show it, and do not change it."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest

from poise.configs.errors import PoiseError
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot, on_terrain
from poise.envs.terrain.stairs import Stairs
from poise.envs.viewing import renderer as rendering
from poise.envs.viewing import window as viewer
from poise.envs.viewing.appearance import FIELD_OF_VIEW
from poise.envs.viewing.overlays import push_arrows
from poise.envs.viewing.renderer import Camera, SceneRenderer
from tests.support.small_biped import write_biped

PUSH = {"impulse": 14.0, "direction": 90.0, "duration": 0.1, "start": 0.04, "body": "torso"}


@pytest.fixture(scope="module")
def robot():
    return load_robot("humanoid")


@pytest.fixture
def simulation(robot):
    return Simulation(robot)


def saved_model(model):
    buffer = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


def amber(frame):
    """Where the picture shows the push arrow's colour."""
    red, green, blue = np.moveaxis(frame.astype(int), 2, 0)
    return (red > 170) & (green > 110) & (blue < 60)


def trajectory(robot, render):
    """All that the simulator holds after each of ten steps, as bytes; and the last frame."""
    env = gymnasium.make(
        "poise/ResidualBalance-v0", robot=robot, render_mode="rgb_array" if render else None
    )
    env.reset(seed=3, options={"push": PUSH})
    base: Any = env.unwrapped
    frame, history = None, []
    data = base.simulation.data
    arrays = [
        *base.simulation.views.members()[2:],
        *base.simulation.state_arrays.members(),
        data.qacc,
    ]
    arrays += [data.qacc_warmstart, data.light_xpos, base.simulation.clock.memory_of("steps")]
    for _ in range(10):
        observation = env.step(np.full(4, 0.3))[0]
        if render:
            frame = env.render()
        history.append([array.tobytes() for array in (observation, *arrays)])
    env.close()
    return history, frame


def test_rendering_does_not_change_a_bit(can_render, robot):
    """Every array of the simulator, the state and the observation; also the model."""
    model = saved_model(robot.model)
    expected, _ = trajectory(robot, render=False)
    history, frame = trajectory(robot, render=True)
    for step, (one, two) in enumerate(zip(expected, history, strict=True)):
        assert one == two, f"step {step}"
    assert frame.shape == (480, 640, 3) and frame.dtype == np.uint8
    assert saved_model(robot.model) == model


def test_frame_shows_the_robot_upright_in_the_middle(can_render, simulation):
    """Bright ground all around, the darker robot inside the frame, taller than wide."""
    renderer = SceneRenderer(simulation, human=False, width=160, height=120)
    frame = renderer.render()
    renderer.close()
    dark = frame.max(axis=2) < 190
    rows, columns = np.nonzero(dark)
    assert frame.mean() > 150
    assert 5 < rows.min() < 40 and 75 < rows.max() < 115
    assert 60 < columns.mean() < 100
    assert np.ptp(rows) > np.ptp(columns)


def test_a_model_without_a_lamp_or_a_sky_films_as_bright_as_one_with_both(
    can_render: None, tmp_path: Path
) -> None:
    """It gets them when it is loaded; they are no part of its dynamics."""
    floor = '<geom name="floor" type="plane" size="5 5 0.1"/>'
    lamp = '<light pos="0 0 4" dir="0 0 -1"/>'
    sky = '<texture type="skybox" builtin="flat" rgb1="1 1 1" width="8" height="8"/>'
    frames, moved = [], []
    for name, world, asset in (("dark", floor, ""), ("lit", floor + lamp, sky)):
        (tmp_path / name).mkdir()
        robot = load_robot(write_biped(tmp_path / name, world=world, asset=asset))
        simulation = Simulation(robot)
        renderer = SceneRenderer(simulation, human=False, width=160, height=120)
        frames.append(renderer.render())
        renderer.close()
        simulation.step(np.zeros(simulation.model.nu), 10)
        moved.append((robot.fingerprint, simulation.data.qpos.tobytes()))
    dark, lit = (frame.mean() for frame in frames if frame is not None)
    assert dark > 180 and dark == pytest.approx(lit, rel=0.02)
    assert moved[0] == moved[1]


def test_same_state_gives_the_same_frame(can_render, simulation):
    """Looking twice changes nothing, and neither does another renderer or its end."""
    first = SceneRenderer(simulation, human=False, width=64, height=48)
    simulation.step(np.zeros(simulation.model.nu), 10)
    expected = first.render()
    other = SceneRenderer(Simulation(load_robot("tall")), human=False, width=80, height=60)
    other.render()
    assert np.array_equal(first.render(), expected)
    other.close()
    assert np.array_equal(first.render(), expected)
    first.close()
    first.close()
    assert first.render() is None and not first.is_open


def test_arrow_reaches_from_its_tail_to_its_tip(can_render, simulation):
    """Seen from the front, a push to the robot's left comes from the left of the picture."""
    front = Camera(azimuth=0.0, elevation=0.0)
    renderer = SceneRenderer(simulation, False, width=320, height=240, camera=front)
    without = renderer.render().astype(int)
    simulation.set_pushes([Push("torso", 0.0, 0.1, 14.0, 90.0)])
    columns = np.nonzero(np.abs(renderer.render() - without).max(axis=(0, 2)) > 25)[0]
    (arrow,) = push_arrows(simulation)
    focal = 120 / np.tan(np.radians(FIELD_OF_VIEW / 2))

    def column(point):
        depth = renderer.view.distance - (point[0] - renderer.view.lookat[0])
        return 160 + focal * (point[1] - renderer.view.lookat[1]) / depth

    assert columns.min() == pytest.approx(column(arrow.start), abs=3)
    assert columns.max() == pytest.approx(column(arrow.end), abs=5)
    assert column(arrow.end) - column(arrow.start) > 30
    renderer.close()


def test_arrow_is_shown_only_during_the_push_and_a_little_after(can_render, robot):
    """Amber pixels of a 0.1 s push: none before, many during, fewer shortly after, then none."""
    simulation = Simulation(robot)
    simulation.set_pushes([Push("torso", 0.1, 0.1, 14.0, 90.0)])
    renderer = SceneRenderer(simulation, human=False, width=160, height=120)
    count = []
    for _ in range(6):
        count.append(int(amber(renderer.render()).sum()))
        simulation.step(np.zeros(simulation.model.nu), 50)
    renderer.close()
    assert count[0] == 0 and count[1] > 20 and count[5] == 0


def test_camera_follows_with_a_delay_and_starts_afresh(can_render, simulation, robot):
    """Part of the way at a step, all of it in the end, at once in a new episode."""
    renderer = SceneRenderer(simulation, human=False, width=32, height=32)
    renderer.render()
    moved = robot.standing_qpos.copy()
    moved[0] += 1.0
    simulation.data.qpos[:] = moved
    simulation.step(np.zeros(simulation.model.nu))
    simulation.clock.steps = 50
    renderer.render()
    assert 0.05 < renderer.view.lookat[0] < 0.5
    simulation.clock.steps = 50_000
    renderer.render()
    assert renderer.view.lookat[0] == pytest.approx(simulation.state.com[0], abs=1e-6)
    simulation.reset(robot.standing_qpos)
    renderer.render()
    assert renderer.view.lookat[0] == pytest.approx(simulation.state.com[0], abs=1e-9)
    renderer.close()


def test_camera_climbs_with_the_robot(can_render, robot):
    """On the landing above nine stairs it looks as high above the ground as at their foot."""
    climber = on_terrain(robot, Stairs())
    simulation = Simulation(climber)
    renderer = SceneRenderer(simulation, human=False, width=32, height=32)
    renderer.render()
    at_the_foot = renderer.view.lookat[2]
    landing = climber.terrain.surfaces()[-1]
    above = robot.standing_qpos.copy()
    above[0] += landing.x_min + 0.5
    above[2] += landing.height
    simulation.reset(above)
    renderer.render()
    assert landing.height == pytest.approx(0.9)
    assert renderer.view.lookat[2] - at_the_foot == pytest.approx(landing.height, abs=1e-9)
    renderer.close()


@pytest.mark.parametrize("name", ["humanoid", "compact", "tall", "toddler"])
def test_every_body_is_visible(name):
    """Also collision geometry in a hidden group, where a body has nothing else to show."""
    robot = load_robot(name)
    model = robot.model
    hidden = model.geom_group.copy()
    try:
        model.geom_group[:] = 3
        shown = rendering.looks(robot, 32, 32, 0.0).geom_group[model.geom_bodyid > 0]
        assert np.all(shown <= 2)
    finally:
        model.geom_group[:] = hidden


@pytest.mark.parametrize("backend", ["disable", "glfw"])
def test_missing_opengl_is_one_clear_error(backend):
    """It names the package and the variable, the second time too; nothing else is printed.

    MuJoCo loads OpenGL by itself, and aborts the process when it is asked again after a failure.
    """
    code = (
        "from poise.envs.robots.robot import load_robot\n"
        "from poise.envs.viewing.offscreen import OffScreen\n"
        "from poise.configs.errors import PoiseError\n"
        "for again in range(2):\n"
        "    try:\n        OffScreen(load_robot().model, 32, 32)\n"
        "    except PoiseError as error:\n        print(error)"
    )
    shown = ("DISPLAY", "WAYLAND_DISPLAY")
    environment = {k: v for k, v in os.environ.items() if k not in shown} | {"MUJOCO_GL": backend}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True)
    first, second = done.stdout.decode().splitlines()
    assert "libosmesa6" in first and "MUJOCO_GL" in first and second == first
    assert done.stderr == b"" and done.returncode == 0


def test_viewer_without_a_display_is_one_clear_error(simulation, monkeypatch):
    """A PoiseError that names the display and the other render mode."""
    import glfw

    monkeypatch.setattr(glfw, "init", lambda: False)
    with pytest.raises(PoiseError, match=r"display.*rgb_array"):
        SceneRenderer(simulation, human=True)


class FakeHandle:
    """What `SceneRenderer` uses of MuJoCo's viewer."""

    def __init__(self, model, data):
        self.cam, self.user_scn = mujoco.MjvCamera(), mujoco.MjvScene(model, 100)
        self.model, self.data, self.opt = model, data, mujoco.MjvOption()
        self.running, self.synced = True, []

    def is_running(self):
        return self.running

    def lock(self):
        return contextlib.nullcontext()

    def sync(self):
        self.synced.append((self.data.qpos.copy(), self.user_scn.ngeom))

    def close(self):
        self.running = False


@pytest.fixture
def window(monkeypatch):
    """A viewer without a window, and a clock that only sleeping moves."""
    import glfw
    import mujoco.viewer

    monkeypatch.setattr(glfw, "init", lambda: True)
    monkeypatch.setattr(
        mujoco.viewer, "launch_passive", lambda model, data, **_: FakeHandle(model, data)
    )
    clock = [100.0]
    monkeypatch.setattr(viewer.atexit, "register", lambda function: function)
    monkeypatch.setattr(rendering.time, "monotonic", lambda: clock[0])

    def sleep(seconds):
        assert seconds >= 0.0
        clock[0] += seconds

    monkeypatch.setattr(rendering.time, "sleep", sleep)
    return clock


def test_viewer_shows_each_step_in_real_time(window, simulation):
    """Positions and marks are handed over at every step; ten steps of 0.02 s take 0.2 s."""
    renderer = SceneRenderer(simulation, human=True)
    handle = renderer.viewer.handle
    assert renderer.render() is None
    start = window[0]
    for _ in range(10):
        simulation.step(np.zeros(simulation.model.nu), 10)
        renderer.render()
        window[0] += 0.005  # what a step costs
    assert window[0] - start == pytest.approx(0.2 + 0.005)
    qpos, count = handle.synced[-1]
    assert np.array_equal(qpos, simulation.data.qpos)
    assert count == len(rendering.marks(simulation)) and len(handle.synced) == 11
    assert handle.data is not simulation.data and handle.model is not simulation.model


def test_viewer_that_was_closed_is_left_alone(window, simulation):
    """A closed window neither shows nor slows down anything."""
    renderer = SceneRenderer(simulation, human=True)
    renderer.viewer.handle.running = False
    assert renderer.render() is None and not renderer.is_open
    assert renderer.viewer.handle.synced == []
    renderer.close()


def test_late_viewer_does_not_hurry_afterwards(window, simulation):
    """After a pause the steps are again shown in real time, not as fast as they can be."""
    renderer = SceneRenderer(simulation, human=True)
    renderer.render()
    window[0] += 5.0
    times = []
    for _ in range(3):
        simulation.step(np.zeros(simulation.model.nu), 10)
        renderer.render()
        times.append(window[0])
    assert np.diff(times) == pytest.approx([0.02, 0.02])
