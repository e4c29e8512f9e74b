"""Steps of captured clips: when feet lift off and land, and where; and on a robot."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.rotations import about_z, multiply
from poise.baselines.motion.retargeting.paces import clip_heading, find_paces
from poise.baselines.motion.retargeting.retarget import retarget
from poise.configs.errors import ConfigError
from tests.support.captured import captured
from tests.support.physics import robot_named

pytestmark = captured


@pytest.fixture(scope="module")
def walk() -> Clip:
    clip = read_bvh(find_bvh("cmu02_walk")).clip
    return clip.turned(-clip_heading(clip))


def test_feet_land_when_they_do_in_the_clip_one_after_the_other(walk: Clip) -> None:
    paces, _ = find_paces(walk)
    assert [pace.foot for pace in paces] == [0, 1, 0, 1, 0, 1]
    planted = measure_contacts(walk).planted
    for pace in paces[:-1]:
        frame = round(pace.land / walk.dt)
        assert planted[frame, pace.foot] and not planted[frame - 1, pace.foot]
    assert paces[-1].place is None  # the last one is beside the other foot
    for before, after in pairwise(paces):
        assert after.lift - before.land >= 0.1 - 1e-9
    ahead = [pace.place[0] for pace in paces[:-1] if pace.place is not None]
    assert np.all(np.diff(ahead) > 0.5) and np.all(np.diff(ahead) < 0.8)  # of 1.2 m/s


def test_left_and_right_are_exchanged_by_a_mirror(walk: Clip) -> None:
    paces, mirrored = find_paces(walk)[0], find_paces(walk.mirrored())[0]
    assert [pace.foot for pace in mirrored] == [1 - pace.foot for pace in paces]
    assert [pace.land for pace in mirrored] == pytest.approx([pace.land for pace in paces])


def test_a_walk_is_a_motion_with_six_steps(walk: Clip) -> None:
    robot = robot_named("humanoid")
    made = retarget(walk, robot)
    assert isinstance(made.clip, RobotClip) and made.clip.planted is not None
    footing = reference_from(made.clip, robot, "walk").footing
    assert footing is not None and made.limit_excess == 0.0 and 0.3 < made.stride < 1.0
    swings, paces = footing.swings, find_paces(walk)[0]
    assert len(swings) == 6
    lands = np.array([land for _, _, land in swings]) - swings[0][2]
    assert lands == pytest.approx([p.land - paces[0].land for p in paces], abs=0.04)
    for foot, lift, land in swings:  # a foot lands ahead of the other one, or beside it
        gap = footing.sample(land).places[foot, 0] - footing.sample(lift).places[foot, 0]
        assert gap[0] > 0.1 and footing.sample(0.5 * (lift + land)).places[foot, 0, 2] > 0.03


def test_jumps_and_turns_are_refused(walk: Clip) -> None:
    root = walk.root.copy()
    root[20:60, 2] += 0.4
    with pytest.raises(ConfigError, match=r"cmu02_walk: feet: both feet are off the ground for"):
        find_paces(replace(walk, root=root))
    turns = np.linspace(0.0, 1.5, len(walk))
    rotations = walk.rotations.copy()
    rotations[:, 0] = multiply(np.array([about_z(a) for a in turns]), rotations[:, 0])
    with pytest.raises(ConfigError, match=r"heading: turns by .*°: at most 45°"):
        clip_heading(replace(walk, rotations=rotations))
