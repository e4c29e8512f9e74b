"""Databases: columns, exact matches on the own clips, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.graphs.matching.database import MatchingDatabase
from poise.baselines.motion.graphs.matching.features import clip_features, feature_groups
from poise.baselines.motion.graphs.matching.player import PlayerCommand
from poise.configs.errors import ConfigError
from tests.support.motion_files import matching_clips
from tests.support.refused import invalid

RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def clips() -> list[Clip]:
    return matching_clips()


@pytest.fixture(scope="module")
def database(clips: list[Clip]) -> MatchingDatabase:
    return MatchingDatabase(clips)


def test_groups_of_equal_weight_vary_alike(clips: list[Clip]) -> None:
    """The squares of a group's deviations add up to about w²."""
    names = [group.name for group in feature_groups()]
    database = MatchingDatabase(clips, weights={**dict.fromkeys(names, 1.0), "limbs": 2.0})
    spread, begin = database.values.std(axis=0), 0
    assert database.values.mean(axis=0) == pytest.approx(0.0, abs=1e-9)
    for group in feature_groups():
        whole = spread[begin : begin + group.size].mean() * np.sqrt(group.size)
        assert whole == pytest.approx(2.0 if group.name == "limbs" else 1.0)
        begin += group.size


def test_matches_are_those_of_brute_force(database: MatchingDatabase) -> None:
    """200 queries of random frames and commands."""
    for _ in range(200):
        clip = int(RNG.integers(len(database.clips)))
        frame = int(RNG.integers(len(database.clips[clip])))
        command = PlayerCommand(*RNG.uniform(-1.5, 1.5, 3))
        query = database.query(clip, frame, command.future(database.ahead))
        found = database.nearest(query)
        distances = np.linalg.norm(database.values[database.entries] - query, axis=1)
        row = int(database.entries[np.argmin(distances)])
        assert database.starts[found.clip] + found.frame == row
        assert found.distance == pytest.approx(distances.min(), abs=1e-9)


def test_a_frame_with_its_own_future_is_found(database: MatchingDatabase) -> None:
    """Except near the end of its clip, which is not gone to."""
    for clip, frame in ((7, 20), (0, 7), (3, 60)):
        table = clip_features(database.clips[clip], database.ahead)
        query = database.query(clip, frame, table[frame, -8:])
        assert database.nearest(query) == (clip, frame, pytest.approx(0.0, abs=1e-7))
    last = len(database.clips[7]) - 1
    table = clip_features(database.clips[7], database.ahead)
    assert database.nearest(database.query(7, last, table[last, -8:])).frame != last


def test_weights_choose_what_counts(clips: list[Clip]) -> None:
    """With only the place ahead, a frame that gets there is found, whatever the posture."""
    only = dict.fromkeys((group.name for group in feature_groups()), 0.0)
    database = MatchingDatabase(clips, weights={**only, "place@1": 1.0})
    found = database.nearest(database.query(0, 0, PlayerCommand(0.4).future(database.ahead)))
    assert database.clips[found.clip].name == "humanoid_walk"
    place = clip_features(database.clips[found.clip], database.ahead)[found.frame, -4:-2]
    assert place == pytest.approx([0.4, 0.0], abs=0.05)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"clips": []}, ["clips", "at least one"]),
        ({"weights": {"hands": 1.0}}, ["'hands'", "limbs", "place@0.5"]),
        ({"weights": {"limbs": -1.0}}, ["weights.limbs"]),
    ],
)
def test_errors_name_what_is_wrong(clips: list[Clip], change: dict, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        MatchingDatabase(**{"clips": clips, **change})
    assert all(word in str(caught.value) for word in words), caught.value


def test_clips_that_end_before_the_future_are_refused(clips: list[Clip]) -> None:
    with invalid("clips", "1 s"):
        MatchingDatabase([clips[0].cut(0.0, 0.5)])


def test_clips_of_two_skeletons_are_refused(clips: list[Clip]) -> None:
    longer = replace(clips[0].skeleton, offsets=2.0 * clips[0].skeleton.offsets)
    other = replace(clips[0], skeleton=longer)
    with invalid("clips"):
        MatchingDatabase([clips[0], other])
