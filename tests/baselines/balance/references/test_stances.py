"""Soles that stand as in standing, wherever that is, and soles that are put to rest."""

import numpy as np
import pytest

from poise.baselines.balance.references.footing import sole_poses, stances_of
from poise.baselines.balance.references.stances import (
    Place,
    at_rest,
    away_from_home,
    carried,
    home_frames,
    home_place,
    place_of,
    why_not_home,
)
from poise.configs.errors import PoiseError
from tests.support.physics import robot_named
from tests.support.robot_clips import ahead_clip


def test_home_is_where_both_soles_stand_as_in_standing_in_any_place() -> None:
    robot = robot_named("humanoid")
    clip = ahead_clip(robot)
    moved = carried(clip.qpos, home_place(robot), Place(np.array([2.0, -1.0]), 2.5))
    there = place_of(robot, moved[0])
    np.testing.assert_allclose([*there.middle, there.heading], [2.0, -1.0, 2.5], atol=1e-6)
    for qpos in (clip.qpos, moved):
        home = home_frames(robot, qpos, clip.planted)
        lift, land = (round(t * 30) for t in (1.3, 2.9))
        assert home[: lift + 1].all() and home[land:].all() and not home[lift + 1 : land].any()
    staggered = round(2.1 * 30)
    assert clip.planted[staggered].all()
    gap, turned = away_from_home(robot, moved[staggered][None])
    assert gap[0] == pytest.approx(0.05 * robot.height_com, abs=1e-3) and turned[0] < 1e-3
    assert f"{100 * gap[0]:.1f} cm and 0°" in why_not_home(
        robot, moved[staggered], np.ones(2, bool)
    )
    assert why_not_home(robot, moved[0], np.ones(2, bool)) == ""


def test_planted_soles_are_put_to_rest_and_the_body_stays() -> None:
    """Legs and root off by a little, as after joins: the soles rest, and swing on between."""
    robot = robot_named("humanoid")
    clip, rng = ahead_clip(robot), np.random.default_rng(0)
    shaken = clip.qpos.copy()
    shaken[:, 7:] += 1e-3 * rng.normal(size=len(robot.joint_names))
    still = at_rest(robot, shaken, clip.planted)
    before, after = sole_poses(robot, shaken), sole_poses(robot, still)
    np.testing.assert_allclose(after[0], before[0], atol=1e-6)  # the CoM
    for foot in range(2):
        down = stances_of(clip.planted[:, foot])
        for a, b in down:
            own = after[1][a : b + 1, foot]
            assert np.ptp(own, axis=0).max() < 1e-6 and np.abs(own[:, 2]).max() < 1e-6
            assert np.abs(after[2][a : b + 1, foot, :2]).max() < 1e-6
        swing = slice(down[0][1], down[1][0] + 1)
        moved = after[1][swing, foot] - before[1][swing, foot]
        assert np.abs(moved).max() < 5e-3 and np.abs(np.diff(moved, axis=0)).max() < 1e-3
    far = clip.qpos.copy()
    far[:, 2] += 0.1
    with pytest.raises(PoiseError, match="a sole cannot rest in frame 0"):
        at_rest(robot, far, clip.planted)
