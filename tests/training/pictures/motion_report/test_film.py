"""The video of a performance: a frame every 40 ms of the first trial, with its ghost."""

from __future__ import annotations

from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.training.cli.entry import main
from poise.training.motion.following.follow import follow
from poise.training.pictures.motion_report.film import MotionFilm
from poise.training.pictures.motion_report.performance import Watched
from tests.support.physics import robot_named


def yellow(frame: np.ndarray) -> int:
    """Pixels of the ghost's colour: red and green, and little blue."""
    red, green, blue = np.moveaxis(frame.astype(int), -1, 0)
    return int(((np.minimum(red, green) - blue > 60) & (red - green < 60)).sum())


@pytest.mark.usefixtures("can_render")
def test_the_first_trial_is_filmed_and_the_ghost_goes_where_the_robot_is_pushed_from(
    tmp_path: Path,
) -> None:
    robot, path, watched = robot_named("humanoid"), tmp_path / "squat.mp4", Watched()
    squat = load_motion("squat", robot)
    with MotionFilm(path, (160, 120), watched) as film:
        follow(squat, robot=robot, starts=2, impulse=60.0, speed=4.0, watch=film)
    assert len(watched.tracers) == 2
    reader = imageio_ffmpeg.read_frames(str(path))
    about = next(reader)
    assert about["size"] == (160, 120) and about["fps"] == film.rate == 25.0
    frames = [np.frombuffer(data, np.uint8).reshape(120, 160, 3) for data in reader]
    trace = watched.tracers[0].trace()
    assert len(frames) == film.frames == pytest.approx(trace.time[-1] * film.rate, abs=2)
    seen = [yellow(frame) for frame in frames]
    ((start, _),) = trace.pushes
    assert max(seen[int(start * film.rate) :]) > 1.5 * seen[0] > 0  # no more inside of the robot


def test_what_is_no_video_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for more, text in (
        (["--video", str(tmp_path / "x.gif")], "the name of a video must end in .mp4 or .webp"),
        (["--video", str(tmp_path / "x.mp4"), "--size", "15", "16"], "size: must be two even"),
        (["--video", "x.mp4", "--fastest"], "fastest: goes with --controller"),
    ):
        assert main(["motion", "follow", "squat", *more]) == 2
        assert text in capsys.readouterr().err
