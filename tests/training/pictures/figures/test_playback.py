"""A motion without physics as pictures: the skeleton beside the robot does what the robot does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.retargeting.tracks import first_heading
from poise.training.cli.entry import main
from poise.training.pictures.figures.playback import SkeletonMarks, looked_at
from tests.support.physics import robot_named


def test_the_skeleton_stands_beside_and_moves_with_the_clip() -> None:
    robot = robot_named("humanoid")
    clip = read_bvh(find_bvh("humanoid_squat")).clip
    skeleton = SkeletonMarks(robot, clip, 0.9, begins=1.0)
    assert skeleton.places[..., 2].min() == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(skeleton.places[0, 0, :2],
                               robot.standing_qpos[:2] + [0.0, robot.height_com])  # fmt: skip
    assert skeleton.marks(0.0)[0].start.tolist() == skeleton.marks(1.0)[0].start.tolist()
    deepest = int(np.argmin(clip.root[:, 2]))
    heights = [min(mark.start[2] for mark in skeleton.marks(1.0 + time) if mark.name == "bone")
               for time in (0.0, deepest * clip.dt)]  # fmt: skip
    hips = [skeleton.places[frame, 0, 2] for frame in (0, deepest)]
    assert hips[0] - hips[1] == pytest.approx(0.9 * np.ptp(clip.root[[0, deepest], 2]))
    assert min(heights) >= 0.0


def test_a_skeleton_that_walks_goes_as_far_as_the_robot_and_is_looked_at() -> None:
    robot = robot_named("humanoid")
    clip = read_bvh(find_bvh("humanoid_walk")).clip.repeated(5)
    whole, half = (SkeletonMarks(robot, clip, 0.9, 1.0, first_heading(clip), stride)
                   for stride in (1.0, 0.5))  # fmt: skip
    end = 1.0 + clip.duration
    ways = [skeleton.root(end) - skeleton.root(0.0) for skeleton in (whole, half)]
    np.testing.assert_allclose(ways[1], 0.5 * ways[0])
    assert ways[0][0] == pytest.approx(0.9 * (clip.root[-1, 0] - clip.root[0, 0]), rel=0.01)
    assert ways[0][0] > 2.0 and abs(ways[0][1]) < 0.1  # along x
    times = np.arange(0.0, end, 1.0 / 25.0)
    root = np.zeros((len(times), 2))
    seen = looked_at(root, 1.0 / 25.0, times, half)
    assert seen[-1] == pytest.approx(0.5 * half.root(end), abs=0.1)  # smoothed
    assert np.abs(np.diff(seen, axis=0)).max() < 0.05
    still = SkeletonMarks(robot, read_bvh(find_bvh("humanoid_squat")).clip, 0.9, 1.0)
    assert np.ptp(looked_at(root, 1.0 / 25.0, times, still), axis=0).max() == 0.0


def test_what_is_no_video_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for more, text in (
        (["--video", str(tmp_path / "x.gif")], "the name of a video must end in .mp4 or .webp"),
        (["--video", str(tmp_path / "x.mp4"), "--size", "15", "16"], "size: must be two even"),
    ):
        assert main(["motion", "play", "humanoid_squat", *more]) == 2
        assert text in capsys.readouterr().err
