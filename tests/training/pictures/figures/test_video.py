"""Videos of episodes and strips of frames."""

import gymnasium
import imageio_ffmpeg
import numpy as np
import PIL.Image
import pytest
from matplotlib.image import imread

from poise.configs.errors import ConfigError, PoiseError, WriteError
from poise.training.pictures.figures.video import (
    WEBP_RATE,
    WEBP_SIZE,
    Episode,
    frame_strip,
    record,
    record_together,
)
from tests.support.weekly import daily


@pytest.fixture(scope="module")
def env():
    return gymnasium.make("poise/TorqueBalance-v0", duration=0.2, pushes=None)


def still(observation):
    return np.zeros(21)


def read(path):
    """Metadata and all frames of a video."""
    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    width, height = meta["size"]
    return meta, [np.frombuffer(f, np.uint8).reshape(height, width, 3) for f in reader]


def test_video_holds_the_episode(can_render, env, tmp_path):
    """H.264 in yuv420p, every second policy step, and an account of the episode."""
    path = tmp_path / "new" / "a.mp4"
    summary = record(env, still, path, {"seed": 1}, size=(64, 48))
    meta, frames = read(path)
    assert meta["codec"] == "h264" and meta["pix_fmt"].startswith("yuv420p")
    assert meta["fps"] == 25.0 and meta["size"] == (64, 48)
    assert len(frames) == summary["frames"] == 6
    assert min(frame.mean() for frame in frames) > 100  # ground and sky are bright
    assert summary["seconds"] == pytest.approx(0.2) and summary["fps"] == 25.0
    assert summary["fallen"] is False and np.isfinite(summary["return"])
    assert [p.name for p in path.parent.iterdir()] == ["a.mp4"]


def test_policies_of_other_periods_are_filmed_together(can_render, env, tmp_path, monkeypatch):
    """Each takes as many steps as fit into the time that the other has played."""
    fast = gymnasium.make("poise/TorqueBalance-v0", duration=0.2, pushes=None, policy_period=0.004)
    times = []
    with Episode(env, still, {"seed": 1}, size=(64, 48)) as a:
        with Episode(fast, still, {"seed": 1}, size=(64, 48)) as b:
            drawn = a.draw

            def draw():
                times.append((a.base.simulation.time, b.base.simulation.time))
                drawn()

            monkeypatch.setattr(a, "draw", draw)
            count = record_together({"a": a, "b": b}, tmp_path / "both.mp4")
            assert (a.base.steps, b.base.steps) == (10, 50)
    assert count == len(times) and times[-1] == pytest.approx((0.2, 0.2))
    np.testing.assert_allclose(*np.array(times[1:]).T, atol=1e-9)


def test_a_robot_that_falls_is_shown_until_it_lies(can_render, tmp_path):
    """Its trial has ended before, and is told as it ended."""
    env = gymnasium.make("poise/TorqueBalance-v0", duration=5.0, pushes=None)
    with Episode(env, still, {"seed": 1}, (64, 48)) as episode:
        episode.start()
        while not episode.done:
            episode.step()
        fell, ended = float(episode.base.simulation.state.com[2]), episode.seconds
        result = episode.base.episode.metrics.mutable_values()
        while not episode.over:
            episode.step()
        assert episode.base.fallen and episode.seconds == ended == pytest.approx(ended)
        assert episode.base.simulation.state.com[2] < 0.8 * fell
        assert episode.base.episode.metrics.mutable_values() == result
    summary = record(env, still, tmp_path / "a.mp4", {"seed": 1}, size=(64, 48), fps=10.0)
    assert summary["fallen"] and summary["seconds"] == ended
    assert summary["frames"] / summary["fps"] > ended + 1.0


def test_a_webp_is_small(can_render, env, tmp_path):
    """Nobody has said its size: that of a page."""
    summary = record(env, still, tmp_path / "a.webp")
    with PIL.Image.open(tmp_path / "a.webp") as picture:
        assert picture.size == WEBP_SIZE
        assert picture.n_frames == summary["frames"] == 4  # of 0.2 s, both ends drawn
    assert summary["fps"] == WEBP_RATE


@pytest.mark.parametrize("fps, slow, frames, rate", daily([(25, 4, 11, 12.5), (50, 1, 11, 50)]))
def test_rate_and_slow_motion(can_render, env, tmp_path, fps, slow, frames, rate):
    """No step is drawn twice: where there are too few, the video has fewer frames a second."""
    summary = record(env, still, tmp_path / "a.mp4", fps=fps, slow_motion=slow, size=(32, 32))
    assert (summary["frames"], summary["fps"]) == (frames, rate)
    assert read(tmp_path / "a.mp4")[0]["fps"] == pytest.approx(rate)


def test_failure_keeps_the_old_file(can_render, env, tmp_path):
    """An error of the policy passes through; no part of a video is left."""

    def broken(observation):
        raise ZeroDivisionError

    path = tmp_path / "a.mp4"
    path.write_bytes(b"old")
    with pytest.raises(ZeroDivisionError):
        record(env, broken, path, size=(32, 32))
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.mp4"]


def test_place_that_cannot_be_written(can_render, env, tmp_path):
    """One clear error that names the file."""
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError) as caught:
        record(env, still, tmp_path / "file" / "a.mp4", size=(32, 32))
    assert caught.value.path.endswith("a.mp4")


@pytest.mark.parametrize(
    "name, options, text",
    [
        ("a.avi", {}, r"\.mp4 or \.webp"),
        ("a.mp4", {"fps": 0.0}, "fps"),
        ("a.mp4", {"slow_motion": float("nan")}, "slow_motion"),
        ("a.mp4", {"size": (33, 32)}, "size"),
    ],
)
def test_bad_settings_are_refused(env, tmp_path, name, options, text):
    """Nothing is written."""
    with pytest.raises(ConfigError, match=text):
        record(env, still, tmp_path / name, **options)
    assert list(tmp_path.iterdir()) == []


def test_other_environments_are_refused(tmp_path):
    """Only ours have a simulation to draw."""
    with pytest.raises(PoiseError, match="CartPole"):
        record(gymnasium.make("CartPole-v1"), still, tmp_path / "a.mp4")


def test_strip_shows_frames_in_order(tmp_path):
    """Row by row from the left; the last row may be short and is white there."""
    colours = [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    frames = [np.full((60, 80, 3), colour, np.uint8) for colour in colours]
    frame_strip(tmp_path / "a.png", frames, [0.0, 0.5, 1.0], columns=2)
    image = np.round(imread(tmp_path / "a.png")[:, :, :3] * 255)
    height, width = image.shape[:2]
    middles = [image[height * r // 4, width * c // 4] for r in (1, 3) for c in (1, 3)]
    assert np.array_equal(middles, [*colours, (255, 255, 255)])
    assert width / height == pytest.approx(4 / 3, rel=0.02)


def test_strip_is_labelled_with_times(tmp_path):
    """Another time is another picture, near the lower left corner only."""
    frames = [np.full((60, 80, 3), 200, np.uint8)] * 2
    for name, last in (("a", 1.0), ("b", 2.0)):
        frame_strip(tmp_path / f"{name}.png", frames, [0.0, last])
    a, b = (imread(tmp_path / f"{name}.png") for name in "ab")
    rows, columns = np.nonzero(np.any(a != b, axis=2))
    assert rows.min() > a.shape[0] * 0.7
    assert a.shape[1] * 0.5 < columns.min() and columns.max() < a.shape[1] * 0.75


@pytest.mark.parametrize("frames, times", [(0, 0), (2, 3)])
def test_strip_without_frames_or_times_is_refused(tmp_path, frames, times):
    """Every frame needs one time."""
    with pytest.raises(ConfigError):
        frame_strip(tmp_path / "a.png", [np.zeros((4, 4, 3), np.uint8)] * frames, [0.0] * times)
