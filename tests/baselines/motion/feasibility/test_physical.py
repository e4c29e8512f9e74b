"""Joins that a robot can do: what they keep, what they choose, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.feasibility.check import FeasibilityLimits, check_joints
from poise.baselines.motion.feasibility.curve import JoinPart
from poise.baselines.motion.feasibility.physical import (
    JoinRefused,
    PhysicalJoin,
    make_shaper,
    physical_join,
)
from poise.baselines.motion.feasibility.trajectory import PlantedRobot, joints_of
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named
from tests.support.robot_clips import packaged_clip


@pytest.fixture(scope="module")
def robot() -> Robot:
    return robot_named("humanoid")


@pytest.fixture(scope="module")
def joined(robot: Robot) -> PhysicalJoin:
    """A squat left on its way down, an arm swing entered in the middle."""
    clips = packaged_clip(robot, "squat"), packaged_clip(robot, "arm_swing")
    return physical_join(robot, *clips, leave=0.8, enter=0.9)


def test_both_clips_are_kept_and_the_join_is_between(robot: Robot, joined: PhysicalJoin) -> None:
    squat, swing = packaged_clip(robot, "squat"), packaged_clip(robot, "arm_swing")
    before, after = round(joined.start / squat.dt), round(joined.end / squat.dt)
    np.testing.assert_allclose(joined.clip.qpos[: before + 1], squat.qpos[:25], atol=1e-6)
    np.testing.assert_allclose(joined.clip.qpos[after:], swing.qpos[27:], atol=1e-6)
    assert joined.end - joined.start == pytest.approx(joined.parts[0].duration)
    assert not joined.through_standing and joined.coefficient > 0.0
    assert joined.clip.about.name == "squat-arm_swing"


def test_what_is_given_is_possible(robot: Robot, joined: PhysicalJoin) -> None:
    """Of the motion that is performed, a spline through all frames, about the join."""
    motion = reference_from(joined.clip, robot, "test")
    times = np.arange(joined.start, joined.end, 0.01)
    judged = check_joints(PlantedRobot(robot), joints_of(motion), times)
    assert judged.feasible, judged.reason
    assert joined.parts[0].feasibility.feasible
    assert joined.parts[0].feasibility.drift.max() < 1e-3


def test_time_has_its_price(robot: Robot, joined: PhysicalJoin) -> None:
    clips = packaged_clip(robot, "squat"), packaged_clip(robot, "arm_swing")
    patient = physical_join(robot, *clips, leave=0.8, enter=0.9, time_price=0.3)
    assert patient.parts[0].duration > joined.parts[0].duration
    assert patient.coefficient < joined.coefficient


def test_knots_bend_what_would_overshoot(robot: Robot) -> None:
    """An elbow left on its way to the limit: 2.5 s later the plain curve has been beyond it."""
    elbow = robot.joint_names.index("left_elbow")
    still = packaged_clip(robot, "standing")
    times = np.arange(61) * still.dt
    moving = replace(still, qpos=np.tile(robot.standing_qpos, (61, 1)))
    moving.qpos[:, 7 + elbow] += 0.25 * (1.0 + np.cos(np.pi * times))
    motions = [reference_from(clip, robot, "") for clip in (moving, still)]
    shaper = make_shaper(robot, still.dt, motions)
    a = shaper.end(motions[0], 0.5, moving.qpos[:16, 7:])
    b = shaper.end(motions[1], 0.0, still.qpos[:, 7:])
    shaped = shaper.attempt(a, b, 75)
    assert isinstance(shaped, JoinPart), shaped
    s, row = np.linspace(0.0, 1.0, 50), 6 + int(np.flatnonzero(shaper.legs.others == elbow)[0])
    plain = shaped.curve._replace(bends=np.zeros_like(shaped.curve.bends))
    low = robot.joint_range[elbow, 0]
    assert plain.at(s)[:, row].min() < low - 0.01
    assert shaped.curve.at(s)[:, row].min() > low and shaped.qpos[:, 7 + elbow].min() > low


def test_what_is_too_far_for_one_way_goes_by_standing(robot: Robot) -> None:
    """A trunk turned from one side to the other in 2.5 s is faster than allowed, half is not."""
    waist = 7 + robot.joint_names.index("abdomen_z")
    still, clips = packaged_clip(robot, "standing", 0.1), []
    for way in (0.3, -0.3):
        qpos = still.qpos.copy()
        qpos[:, waist] += way
        clips.append(replace(still, qpos=qpos))
    limits = FeasibilityLimits(speed=0.36)  # [rad/s]; 15/8 · 0.6 rad/2.5 s is 0.45
    join = physical_join(robot, *clips, limits=limits)
    assert join.through_standing and len(join.parts) == 2
    assert all(part.feasibility.speed.max() <= limits.speed for part in join.parts)
    with pytest.raises(JoinRefused, match=r"'standing' at .* joint speed .* is needed"):
        physical_join(robot, *clips, limits=limits, through=False)


def test_no_way_at_all_says_why(robot: Robot) -> None:
    clips = packaged_clip(robot, "squat"), packaged_clip(robot, "bow")
    with pytest.raises(JoinRefused, match=r"no way from 'squat' at 0.80 s to 'bow' at 1.00 s: tor"):
        physical_join(robot, *clips, leave=0.8, enter=1.0, through=False,
                      limits=FeasibilityLimits(torque=0.05))  # fmt: skip


def test_times_outside_are_errors(robot: Robot) -> None:
    clip = packaged_clip(robot, "standing")
    for times in ({"leave": 99.0}, {"enter": -0.1}):
        with pytest.raises(ConfigError, match=rf"{next(iter(times))}: must be from 0 to"):
            physical_join(robot, clip, clip, **times)
