"""Footsteps of a trial against those of its motion: number, feet, times, places."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.footfalls import footfalls
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.retargeting.retarget import retarget
from poise.training.motion.following.follow import follow
from poise.training.motion.following.footsteps import Steps, compare
from tests.support.captures import CAPTURES, make
from tests.support.physics import robot_named

PERIOD = 0.02
#: time, foot, ahead and left of the other one: four steps of 0.3 m, 0.5 s apart
WALK = np.array([[1.0 + 0.5 * k, k % 2, 0.3, 0.2 - 0.4 * (k % 2)] for k in range(4)])


def walked(steps: np.ndarray, yaw: float) -> Steps:
    """A robot that faces `yaw` and takes these steps, as a `Watch` sees it; motion as `WALK`."""
    motion = cast(ReferenceMotion, SimpleNamespace(footfalls=WALK, commands=np.zeros((2, 5))))
    watch, turn = Steps(motion), Rotation.from_euler("z", yaw).as_matrix()
    places = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]) @ turn.T
    for k in range(200):
        time, contacts = k * PERIOD, np.ones(2)
        for land, foot, ahead, left in steps:
            foot = int(foot)
            if land - 0.3 < time < land - 1e-9:
                contacts[foot] = 0.0
            elif abs(time - land) < 1e-9:
                places[foot] = places[1 - foot] + turn @ [ahead, left, 0.0]
        state = SimpleNamespace(contacts=contacts, sole_points=places,
                                sole_axes=np.stack([turn, turn]))  # fmt: skip
        watch(cast(Any, SimpleNamespace(simulation=SimpleNamespace(state=state), motion_time=time)))
    return watch


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_steps_as_the_motion_s_are_kept_wherever_the_robot_faces(yaw: float) -> None:
    found = walked(WALK, yaw).figures()
    assert (found.number, found.kept) == (1.0, 1.0)
    assert found.delay == pytest.approx(0.0, abs=1e-9) and found.place == pytest.approx(0.0)


def test_a_late_walk_a_missing_step_a_wrong_foot_and_a_wrong_place_are_told_apart() -> None:
    late = walked(WALK + [0.2, 0.0, 0.0, 0.0], 0.0).figures()
    assert (late.number, late.kept) == (1.0, 1.0) and late.delay == pytest.approx(0.2)
    fewer = walked(WALK[[0, 1, 3]], 0.0).figures()
    assert (fewer.number, fewer.kept) == (0.75, 0.75)
    other = WALK.copy()
    other[2, 1] = 1.0
    assert walked(other, 0.0).figures().kept == 0.75
    wide = walked(WALK + [0.0, 0.0, 0.06, 0.08], 0.0).figures()
    assert wide.kept == 1.0 and wide.place == pytest.approx(0.1)


def test_times_count_to_a_tenth_of_a_second_and_more_steps_count_against() -> None:
    off = WALK.copy()
    off[1, 0] += 0.09
    off[2, 0] += 0.11
    assert compare(WALK, off).kept == 0.75
    assert compare(WALK, WALK + [0.2, 0, 0, 0]).kept == 0.0  # of its own soles, nothing is late
    more = np.concatenate([WALK, WALK[1:] - [0.25, 0.0, 0.0, 0.0]])
    found = compare(WALK, more[np.argsort(more[:, 0])])
    assert found.number == 1.75 and found.kept == pytest.approx(4 / 7)
    assert np.isnan(compare(np.empty((0, 4)), WALK).kept)


def test_footfalls_of_frames_are_where_feet_land_from_the_other_one() -> None:
    """Feet that face along y: a step of 0.4 m there is one ahead."""
    planted = np.array([[1, 1], [0, 1], [1, 1], [1, 0], [1, 1]], dtype=bool)
    places = np.zeros((5, 2, 3))
    places[:, 0, :2], places[:, 1, :2] = [-0.1, 0.0], [0.1, 0.0]
    places[2:, 0, 1], places[4:, 1, 1] = 0.4, 0.8
    turns = np.tile([0.0, 0.0, 0.5 * np.pi], (5, 2, 1))
    found = footfalls(np.arange(5) * 0.5, places, turns, planted)
    assert found == pytest.approx(np.array([[1.0, 0, 0.4, 0.2], [2.0, 1, 0.4, -0.2]]))


def test_a_clip_whose_steps_are_known_is_stepped_so() -> None:
    """A made clip that steps backwards: every step at its time and place by `motion-step`."""
    robot, (clip, _) = robot_named("humanoid"), make("backwards")
    motion = reference_from(retarget(clip, robot).clip, robot, "backwards")
    lands = sorted(a for foot in CAPTURES["backwards"].stances for a, _ in foot)
    known = [land for land in lands if 0.0 < land < clip.duration - 0.2]
    # the last one is put beside the other foot
    gaps = np.diff(motion.footfalls[: len(known), 0])
    assert gaps == pytest.approx(np.diff(known), abs=0.07)
    (trial,) = follow(motion, "motion-step", robot=robot, starts=1)
    assert not trial.fallen and (trial.footsteps, trial.footsteps_kept) == (1.0, 1.0)
    assert trial.footstep_delay == 0.0 and trial.footstep_place < 0.03
