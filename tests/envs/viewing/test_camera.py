"""envs/viewing/camera.py, and the size and camera of an environment's frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest

import poise
from poise.envs import Camera, TorqueBalanceEnv, load_robot, replicate
from poise.envs.viewing.camera import beside, find_camera, point

TORQUE = "poise/TorqueBalance-v0"


def frame(**arguments: Any) -> Any:
    """The first picture of an episode without noise."""
    env = gymnasium.make(TORQUE, render_mode="rgb_array", pushes=None, **arguments)
    env.reset(seed=0, options={"noise": 0.0})
    picture = env.render()
    env.close()
    return picture


def test_a_camera_is_found_by_name_by_id_and_by_place() -> None:
    model = load_robot("humanoid").model
    track = model.camera("track").id
    assert find_camera("track", model) == find_camera(track, model) == track
    assert find_camera(np.int64(1), model) == 1
    assert find_camera(None, model) == Camera()
    assert find_camera({"azimuth": 90.0}, model) == find_camera(Camera(90.0), model) == Camera(90.0)


@pytest.mark.parametrize("camera", ["tracks", 2, -1, True, 1.0, ["track"]])
def test_a_camera_that_is_not_there_is_refused_with_those_that_are(camera: Any) -> None:
    """When the environment is made, not at its first frame."""
    with pytest.raises(
        poise.ConfigError, match=r"^camera: .*no camera .*\(choices: None, track, 1"
    ):
        TorqueBalanceEnv(camera=camera)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"width": 0}, "width: must be at least 1, not 0"),
        ({"height": 48.0}, "height: must be a whole number, not float"),
        ({"camera": {"distance": -1.0}}, "camera: distance: must be above 0"),
        ({"camera": {"azimut": 1.0}}, "camera: azimut: .*choices: azimuth"),
    ],
)
def test_wrong_frames_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(poise.ConfigError, match=message):
        TorqueBalanceEnv(**arguments)


def test_a_view_stands_where_the_camera_does() -> None:
    view = mujoco.MjvCamera()
    point(view, Camera(azimuth=10.0, elevation=20.0, distance=3.0), 0.5)
    assert (view.azimuth, view.elevation, view.distance) == (190.0, -20.0, 1.5)
    point(view, 1, 0.5)
    assert (view.type, view.fixedcamid) == (mujoco.mjtCamera.mjCAMERA_FIXED, 1)


def test_frames_have_the_size_and_the_camera_asked_for(can_render: None) -> None:
    """Through `gymnasium.make`; Poise's own camera is the default."""
    own, track = frame(width=96, height=64), frame(width=96, height=64, camera="track")
    assert own.shape == track.shape == (64, 96, 3)
    assert np.array_equal(own, frame(width=96, height=64, camera={}))
    assert np.mean(own != track) > 0.1
    assert np.array_equal(track, frame(width=96, height=64, camera=0))


def test_a_replica_draws_alike() -> None:
    env = TorqueBalanceEnv(width=96, height=64, camera="track")
    other = replicate(env, 2)[1]
    assert (other.width, other.height, other.camera) == (96, 64, env.camera)


def test_the_model_and_the_data_are_those_of_mujoco() -> None:
    """As in Gymnasium's own MuJoCo environments: the data follow the simulation."""
    env = gymnasium.make(TORQUE, pushes=None)
    env.reset(seed=0)
    base = env.unwrapped
    assert type(base.model) is mujoco.MjModel and type(base.data) is mujoco.MjData
    assert base.model is base.robot.model and base.data is base.simulation.data
    before = base.data.qpos.copy()
    env.step(env.action_space.sample())
    assert base.data.time == pytest.approx(base.config.policy_period)
    assert not np.array_equal(base.data.qpos, before)
    assert np.array_equal(base.data.qpos, base.simulation.views.qpos)


def test_a_time_limit_of_gymnasium_s_own_comes_on_top() -> None:
    """No wrapper cuts off a longer `duration`, which the spec tells; whoever wants one names it."""
    long = gymnasium.make(TORQUE, duration=7.0)
    assert long.spec.max_episode_steps == long.unwrapped.max_steps == 350
    short: Any = gymnasium.make(TORQUE, pushes=None, max_episode_steps=2)
    short.reset(seed=0)
    zero = np.zeros(short.action_space.shape, dtype=np.float32)
    assert [short.step(zero)[3] for _ in range(2)] == [False, True]


@pytest.mark.parametrize("direction", [-170.0, -90.0, 0.0, 33.0, 90.0, 180.0, 300.0])
def test_a_push_is_seen_from_its_side(direction: float) -> None:
    """The camera's line of sight is 65° off the push's line, and it stays in front where it can."""
    camera = beside(direction)
    apart = abs((camera.azimuth - direction + 180.0) % 360.0 - 180.0)
    assert min(apart, 180.0 - apart) == pytest.approx(65.0)
    assert camera == replace(Camera(), azimuth=camera.azimuth)
    assert abs((camera.azimuth - 50.0 + 180.0) % 360.0 - 180.0) <= 65.0
