"""A whole clip at once: smoother, as near to it, planted; constraints met, or their lack said."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.space_time.constraints.constraint import Constraint, When
from poise.baselines.motion.space_time.constraints.points import Height, Keep, PointReach
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip, Solver, retarget_clip
from poise.configs.errors import ConfigError
from tests.support.captured import captured
from tests.support.physics import robot_named
from tests.support.refused import refused

LEAD = 0.3
WANTED: tuple[Constraint, ...] = (
    PointReach(point="hand_right", place=(0.3, 0.2, 1.3), period=When(at=0.3)),
    Keep(point="hand_left", period=(0.1, 0.5)),
)


@cache
def clip() -> Clip:
    return read_bvh(find_bvh("humanoid_punch")).clip.cut(1.0, 1.6)


@cache
def made(solver: Solver, constrained: bool) -> RetargetedClip:
    return retarget_clip(clip(), robot_named("humanoid"), solver=solver, lead=LEAD,
                         constraints=WANTED if constrained else ())  # fmt: skip


def test_smoother_and_as_near() -> None:
    """On a captured punch, which is rough: a third derivative that is 30 % lower for at most a
    tenth more of the task error."""
    punch, robot = captured("cmu02_punch").cut(1.2, 1.8), robot_named("humanoid")
    solvers: tuple[Solver, ...] = ("frame", "spacetime")
    both = [retarget_clip(punch, robot, solver=solver, lead=LEAD) for solver in solvers]
    frame, whole = (found.quality for found in both)
    assert whole.jerk < 0.7 * frame.jerk
    assert whole.task_error < 1.1 * frame.task_error
    assert whole.sole_error < 1e-6 and whole.skating_largest < 1e-5
    assert whole.limit_excess == 0.0 and whole.penetration < 1e-3
    ends = [found.clip.qpos[[0, -1]] for found in both]
    assert np.array_equal(*ends)


def test_constraints_are_met_where_single_frames_miss_them() -> None:
    missed, met = made("frame", True).quality, made("spacetime", True).quality
    assert min(each.largest for each in missed.violations) > 0.02
    assert all(each.holds for each in met.violations)
    assert met.sole_error < 1e-6 and met.limit_excess == 0.0
    reference_from(made("spacetime", True).clip, robot_named("humanoid"), "test")


def test_by_trial_misses_less_than_single_frames_and_is_rougher_than_the_optimum() -> None:
    missed, tried = made("frame", True).quality, made("grid", True).quality
    for before, after in zip(missed.violations, tried.violations, strict=True):
        assert after.largest < 0.5 * before.largest
    assert tried.sole_error < 1e-6 and tried.limit_excess == 0.0
    assert tried.jerk > made("spacetime", True).quality.jerk


def test_what_cannot_be_is_missed_by_little_and_said() -> None:
    """A hand that is to be 3 m up, or still in place below: the optimum ends, and lists it."""
    robot, high = (
        robot_named("humanoid"),
        Height(point="hand_right", least=3.0, period=When(at=0.3)),
    )
    found = retarget_clip(clip(), robot, constraints=[high], lead=LEAD)
    assert found.solver == "spacetime"
    (only,) = found.quality.violations
    assert not only.holds and 1.0 < only.largest < 2.3 and only.time == pytest.approx(0.3, abs=0.02)
    assert found.quality.sole_error < 1e-6 and found.quality.limit_excess == 0.0


def test_bad_arguments() -> None:
    robot = robot_named("humanoid")
    with pytest.raises(ConfigError, match=r"solver: .*\(choices: frame, spacetime, grid\)"):
        retarget_clip(clip(), robot, solver="magic")
    many = [Height(point="pelvis", least=0.1)] * 10
    with pytest.raises(ConfigError, match="at most 9 constraints can hold at one time, not 10"):
        retarget_clip(clip(), robot, solver="grid", constraints=many, lead=LEAD)
    with refused("unknown name", "constraints", value="'nothing'"):
        retarget_clip(clip(), robot, constraints="nothing")
