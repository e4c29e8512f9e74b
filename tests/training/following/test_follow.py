"""Motions are performed: errors are small where the robot stands, and falls are counted."""

import numpy as np
import pytest

from poise.baselines.clips.bvh import read_bvh
from poise.baselines.clips.library import find_bvh
from poise.baselines.motions.robot_clip import reference_from
from poise.baselines.retargeting.retarget import retarget
from poise.configs.errors import ConfigError
from poise.training.following.follow import follow
from poise.training.trials.push_limits import load_limits
from tests.support.physics import robot_named


def test_a_captured_clip_is_followed() -> None:
    """Both arms overhead: no fall, joints to 3°, bodies to 2 cm."""
    robot = robot_named("humanoid")
    clip = read_bvh(find_bvh("cmu02_reach_up")).clip
    motion = reference_from(retarget(clip, robot).clip, robot, "test")
    (trial,) = follow(motion, robot=robot, starts=1)
    assert not trial.fallen and trial.solver_failures == 0
    assert 0.0 < np.degrees(trial.joint_rms) < 3.0
    assert 0.0 < trial.body_error < 0.02 and trial.body_error_root < 0.02


def test_a_hard_push_is_a_fall_and_standing_is_none() -> None:
    robot = robot_named("humanoid")
    (fallen,) = follow("standing", robot=robot, starts=1, impulse=200.0)
    assert fallen.fallen and fallen.push is not None and fallen.push["impulse"] == 200.0
    (still,) = follow("standing", robot=robot, starts=1)
    assert not still.fallen


def test_standing_still_is_an_error_of_zero() -> None:
    (still,) = follow("standing", robot=robot_named("humanoid"), starts=1)
    assert still.body_error_last < 3e-3


def test_what_follows_no_motion_is_said() -> None:
    with pytest.raises(ConfigError, match="'zero' follows no motion"):
        follow("standing", "zero", robot=robot_named("humanoid"), starts=1)
    with pytest.raises(ConfigError, match="starts: must be at least 1"):
        follow("standing", starts=0)
    with pytest.raises(ConfigError, match="seed: must be at least 0"):
        follow("standing", seed=-1)
    with pytest.raises(ConfigError, match="share: give either an impulse or a share of J50"):
        follow("standing", impulse=1.0, share=0.5)
    with pytest.raises(ConfigError, match="share: no J50 of 'compact' was measured"):
        follow("standing", robot=robot_named("compact"), share=0.5)


def test_a_share_of_j50_is_that_of_the_direction() -> None:
    robot = robot_named("humanoid")
    table = load_limits(robot).table
    assert table is not None
    trials = follow("standing", robot=robot, starts=2, directions=2, share=0.3)
    assert [trial.push["impulse"] for trial in trials if trial.push] == pytest.approx(
        [0.3 * table(0.0), 0.3 * table(180.0)]
    )
    assert not any(trial.fallen for trial in trials)
