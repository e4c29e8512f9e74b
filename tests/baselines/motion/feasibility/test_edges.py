"""Beside its cuts a join may be as bad as the clips are there, and no worse."""

from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.motion.feasibility.check import Feasibility, FeasibilityLimits, check_motion
from poise.baselines.motion.feasibility.edges import between_clips, clip_limits, masked
from tests.support.physics import robot_named


def judged() -> Feasibility:
    robot = robot_named("humanoid")
    return check_motion(load_motion("squat", robot), robot)


def with_margin(one: Feasibility, begin: float, end: float, margin: float) -> Feasibility:
    inside = (one.times > begin) & (one.times < end)
    return replace(one, zmp_margin=np.where(inside, margin, one.zmp_margin))


def test_a_part_has_its_samples_and_its_own_limits() -> None:
    whole = judged()
    kept = (whole.times > 0.495) & (whole.times < 1.005)
    cut = masked(whole, kept, FeasibilityLimits(torque=0.1))
    assert len(cut.times) == len(cut.torque) == len(cut.zmp) == 51
    assert cut.times[0] == 0.5 and cut.limits.torque == 0.1 and not cut.feasible
    np.testing.assert_array_equal(cut.support, whole.support)


def test_a_join_may_be_as_bad_as_its_clips_beside_the_cuts_alone() -> None:
    good = judged()
    last = float(good.times[-1])
    bad = with_margin(good, -1.0, 99.0, -0.05)
    cases = (
        (with_margin(good, -1.0, 0.09, -0.05), bad, good, True),
        (with_margin(good, -1.0, 0.09, -0.05), good, bad, False),
        (with_margin(good, last - 0.09, 99.0, -0.05), good, bad, True),
        (with_margin(good, -1.0, 0.09, -0.06), bad, good, False),  # worse than the clip
        (with_margin(good, 0.5, 0.6, -0.05), bad, bad, False),  # not beside a cut
        (with_margin(good, 0.11, 0.14, -0.02), bad, good, True),  # two thirds as bad
        (with_margin(good, 0.11, 0.14, -0.05), bad, good, False),
        (with_margin(good, last - 0.19, last - 0.16, -0.01), good, bad, True),  # one third
        (with_margin(good, last - 0.19, last - 0.16, -0.02), good, bad, False),
        (with_margin(good, 0.11, 0.14, -0.02), good, bad, False),  # of the other clip
    )
    for join, before, after, possible in cases:
        reason = between_clips(join, before, after)
        assert (reason == "") is possible, reason


def test_limits_are_never_harder_than_they_were() -> None:
    own = judged()
    assert clip_limits(own) == own.limits  # a possible clip changes nothing
    limits = FeasibilityLimits(torque=0.1, friction=1e-3, load=(1.0, 1.0))
    softer = clip_limits(replace(own, limits=limits))
    assert softer.torque > own.torque.max() and softer.friction > own.friction.max()
    assert softer.load[0] < own.load.min() and softer.load[1] > own.load.max()
