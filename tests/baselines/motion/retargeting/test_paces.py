"""Steps of captured clips: when feet lift off and land, and where; and on a robot."""

from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import longest_flight, measure_contacts
from poise.baselines.motion.retargeting import leaps, paces
from poise.baselines.motion.retargeting.paces import find_paces
from poise.baselines.motion.retargeting.retarget import retarget
from poise.configs.errors import ConfigError
from tests.support.captured import captured
from tests.support.captures import make
from tests.support.physics import robot_named
from tests.support.robot_clips import swings


@pytest.fixture(scope="module")
def walk() -> Clip:
    return captured("cmu02_walk")


def test_feet_land_when_they_do_in_the_clip_one_after_the_other(walk: Clip) -> None:
    paces = find_paces(walk)
    assert [pace.foot for pace in paces] == [0, 1, 0, 1, 0, 1]
    planted = measure_contacts(walk).planted
    for pace in paces[:-1]:
        frame = round(pace.land / walk.dt)
        assert planted[frame, pace.foot] and not planted[frame - 1, pace.foot]
    assert paces[-1].end is None  # the last one is beside the other foot
    for before, after in pairwise(paces):
        assert after.lift - before.land >= 0.1 - 1e-9


def test_left_and_right_are_exchanged_by_a_mirror(walk: Clip) -> None:
    paces, mirrored = find_paces(walk), find_paces(walk.mirrored())
    assert [pace.foot for pace in mirrored] == [1 - pace.foot for pace in paces]
    assert [pace.land for pace in mirrored] == pytest.approx([pace.land for pace in paces])


@pytest.mark.parametrize(
    ("name", "stride", "turn"), [("turn-in-place", 1.0, 3.0), ("backwards", 0.9, 0.0)]
)
def test_made_clips_become_motions_with_their_steps(name: str, stride: float, turn: float) -> None:
    """Feet land when the clip's do, and the robot faces, where and how far it goes, as the clip."""
    robot, (clip, _) = robot_named("humanoid"), make(name)
    made = retarget(clip, robot)
    assert made.clip.planted is not None and made.limit_excess == 0.0 and made.stride >= stride
    footing = reference_from(made.clip, robot, name).footing
    assert footing is not None
    paces = find_paces(clip)
    lands = np.array([land for _, _, land in swings(footing)])
    assert lands == pytest.approx([p.land + made.begins for p in paces], abs=0.04)
    end = footing.sample(made.clip.duration)
    assert end.root[0, 2] == pytest.approx(turn, abs=0.25)
    assert end.turns[:, 0, 2] == pytest.approx([end.root[0, 2]] * 2, abs=0.05)
    way = (clip.root[-1] - clip.root[0])[:2] * made.scale * made.stride
    assert end.com[0, :2] - footing.sample(0.0).com[0, :2] == pytest.approx(way, abs=0.25)
    for foot, lift, land in swings(footing):
        assert footing.sample(0.5 * (lift + land)).places[foot, 0, 2] > 0.03


def test_a_flight_of_less_than_a_tenth_of_a_second_is_stepped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As in dances: at some steps the other foot leaves 0.08 s before one lands, which then lands
    when it did."""
    clip = make("backwards")[0]
    contacts, before = measure_contacts(clip), find_paces(clip)
    planted, early = contacts.planted.copy(), round(0.08 / clip.dt)
    for pace in before[1:-1:3]:
        land, other = round(pace.land / clip.dt), 1 - pace.foot
        lift = land + int(np.argmin(contacts.planted[land:, other]))
        planted[land - early : lift, other] = False
    assert 0.0 < longest_flight(planted, clip.dt)[1] < 0.1
    for module in (paces, leaps):
        monkeypatch.setattr(
            module, "measure_contacts", lambda _: contacts._replace(planted=planted)
        )
    assert leaps.find_leaps(clip) == []
    after = find_paces(clip)
    assert [p.foot for p in after] == [p.foot for p in before]
    assert [p.land for p in after] == pytest.approx([p.land for p in before], abs=0.08)
    planted[land - round(0.12 / clip.dt) : land, other] = False
    with pytest.raises(ConfigError, match="both feet are off the ground for 0.1"):
        find_paces(clip)


def test_a_foot_that_stays_up_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = make("backwards")[0]
    contacts = measure_contacts(clip)
    planted = np.ones_like(contacts.planted)
    planted[round(1.5 / clip.dt) :, 1] = False
    monkeypatch.setattr(paces, "measure_contacts", lambda _: contacts._replace(planted=planted))
    with pytest.raises(ConfigError, match=r"its right foot lifts off at 1\.49 s and does not land"):
        find_paces(clip)


def test_a_foot_that_never_stands_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = make("backwards")[0]
    contacts = measure_contacts(clip)
    planted = np.ones_like(contacts.planted)
    planted[:, 1] = False
    monkeypatch.setattr(paces, "measure_contacts", lambda _: contacts._replace(planted=planted))
    with pytest.raises(ConfigError, match="its right foot does not land"):
        find_paces(clip)


def test_flights_and_whole_turns_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"feet: both feet are off the ground for 0.48 s at 1.00"):
        find_paces(make("jump")[0])
    with pytest.raises(ConfigError, match=r"heading: turns by 38.°: at most 300°"):
        find_paces(make("circle")[0])
