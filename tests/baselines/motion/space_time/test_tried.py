"""baselines/motion/space_time/tried.py: which way to walk a clip is taken."""

from collections.abc import Sequence

import pytest

from poise.baselines.balance.references.robot_clip import RobotClip
from poise.baselines.motion.retargeting.retarget import Rehearsed, retarget_freely
from poise.baselines.motion.space_time.tried import held_walk
from poise.baselines.motion.space_time.walked import Walked, find_commands
from tests.support.captures import make
from tests.support.physics import robot_named

ROBOT, CLIP = robot_named("humanoid"), make("walk")[0]
FREE = retarget_freely(CLIP, ROBOT)
FOUND = find_commands(CLIP, ROBOT, FREE.scale, 0.7)
FELL = (0.5, 1.0)
OWN, OTHERS = 12, 8  # ways with the clip's own steps, by two planners, and with a planner's


def walked(trials: Sequence[tuple[float, float]]) -> tuple[RobotClip, Walked, bool]:
    """The way that is taken if trials come out so; all are used."""
    left = iter([Rehearsed(*trial) for trial in trials])
    made = held_walk(CLIP, FOUND, FREE, ROBOT, lambda clip, controller: next(left))
    assert next(left, None) is None
    return made


def test_a_walk_that_never_holds_is_the_one_that_fails_last() -> None:
    first = walked([FELL] * (OWN + OTHERS))
    assert not first[2] and first[1] == FOUND and not first[0].about.free_arms
    _, found, held = walked([FELL] * OWN + [(0.6, 0.2)] + [FELL] * (OTHERS - 1))
    assert not held and found.bound


def test_the_planners_steps_are_taken_where_the_robot_falls_with_the_clips() -> None:
    clip, found, held = walked([FELL] * OWN + [(1.0, 0.2)])
    assert held and found.bound == "the robot falls with its own steps, or does not take them"
    assert not clip.about.free_arms and found.tempo == 1.0


def test_own_steps_are_taken_by_the_planner_for_fast_walks_where_the_first_one_falls() -> None:
    clip, found, held = walked([*[FELL] * 3, (1.0, 0.95)])
    assert held and found.walker == "walk-fast" and found.tempo == FOUND.tempo
    assert not found.bound and not clip.about.free_arms


def test_own_steps_that_are_mostly_kept_are_better_than_the_planners() -> None:
    """A way that keeps more of them is looked for."""
    clip, found, held = walked([(1.0, 0.8), (1.0, 0.7), *[FELL] * 4, (1.0, 0.95)])
    assert held and not found.bound and clip.about.free_arms and found.walker == "walk"
    clip, found, held = walked([(1.0, 0.8), (1.0, 0.85), *[FELL] * 10, (1.0, 0.2)])
    assert held and not found.bound and not clip.about.free_arms
    assert found.tempo == pytest.approx(0.9 * FOUND.tempo)


def test_own_steps_that_are_hardly_kept_are_others() -> None:
    *_, held = taken = walked([(1.0, 0.5)] * OWN + [(1.0, 0.2)])
    assert held and taken[1].bound
    *_, held = taken = walked([(1.0, 0.5)] * OWN + [FELL] * OTHERS)
    assert held and not taken[1].bound
