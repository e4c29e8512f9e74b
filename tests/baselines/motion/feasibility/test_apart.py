"""Joins of motions with steps: the feet go on from where they are, and the ground bears it."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.foot_steps import FootStep, Waypoint
from poise.baselines.balance.references.footing import sole_poses
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.balance.references.stances import place_of
from poise.baselines.motion.feasibility.check import check_motion
from poise.baselines.motion.feasibility.physical import PhysicalJoin, physical_join
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named
from tests.support.robot_clips import ahead_clip, packaged_clip, steps_clip, swings


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def joined(robot: Robot) -> PhysicalJoin:
    """A step ahead, left while the weight still moves back; an arm swing; the step once more."""
    ahead, swing = ahead_clip(robot), packaged_clip(robot, "arm_swing")
    first = physical_join(robot, ahead, swing, leave=3.6, enter=0.4).clip
    return physical_join(robot, first, ahead, leave=4.8, enter=0.6)


def test_soles_are_planted_as_scheduled_and_rest_where_they_landed(
    robot: Robot, joined: PhysicalJoin
) -> None:
    clip = joined.clip
    motion = reference_from(clip, robot, "test")
    assert motion.footing is not None and clip.planted is not None
    assert [foot for foot, *_ in swings(motion.footing)] == [
        foot for foot, *_ in swings(reference_from(ahead_clip(robot), robot, "").footing)
    ] * 2
    h = robot.height_com
    _, places, _ = sole_poses(robot, clip.qpos)
    for foot in range(2):
        ahead = places[clip.planted[:, foot], foot, 0]
        assert np.unique(np.round(ahead - ahead[0], 4)).tolist() == pytest.approx(
            [0.0, 0.1 * h, 0.2 * h], abs=1e-3
        )
        assert np.abs(places[clip.planted[:, foot], foot, 2]).max() < 1e-5
    assert place_of(robot, clip.qpos[-1]).middle[0] == pytest.approx(
        place_of(robot, clip.qpos[0]).middle[0] + 0.2 * h, abs=1e-3
    )


def test_nothing_jumps_at_the_cuts(robot: Robot, joined: PhysicalJoin) -> None:
    """A step between frames is as long as those beside it, of root, CoM, soles and joints."""
    qpos = joined.clip.qpos
    com, places, _ = sole_poses(robot, qpos)
    for values in (qpos[:, :3], com, places.reshape(len(qpos), -1), qpos[:, 7:]):
        steps = np.abs(np.diff(values, axis=0))
        bends = np.abs(np.diff(steps, axis=0)).max()
        for cut in (round(joined.start * 30), round(joined.end * 30)):
            assert np.abs(np.diff(values[cut - 1 : cut + 2], 2, axis=0)).max() <= bends + 1e-4
            assert steps[cut].max() < 0.05


def test_the_planted_soles_bear_it(robot: Robot, joined: PhysicalJoin) -> None:
    judged = check_motion(joined.clip, robot)
    assert judged.feasible, judged.reason
    assert judged.zmp_margin.min() > 0.01


def test_what_is_cut_in_a_step_or_ends_otherwise_is_refused(robot: Robot) -> None:
    ahead, swing = ahead_clip(robot), packaged_clip(robot, "arm_swing")
    apart = steps_clip(robot, "apart", [FootStep("left", 1.3, 1.9, (Waypoint(1.6, up=0.05),),
                                                 ahead=0.1)], 3.3)  # fmt: skip
    for clip, leave, said in (
        (ahead, 1.6, "ahead: leave: at 1.60 s a foot swings: no join is possible there"),
        (ahead, 2.1, r"ahead: leave: at 2.10 s the feet are \d.\d cm and 0° from how they stand"),
        (apart, None, r"apart: leave: at 3.30 s the feet are \d.\d cm and 0° from how they stand"),
    ):
        with pytest.raises(ConfigError, match=said):
            physical_join(robot, clip, swing, leave=leave)
    with pytest.raises(ConfigError, match="ahead: enter: at 1.60 s a foot swings"):
        physical_join(robot, swing, ahead, enter=1.6)
    with pytest.raises(ConfigError, match="ahead: dt: has 15 frames a second, and 'arm_swing'"):
        physical_join(robot, swing, replace(ahead, dt=1 / 15))
