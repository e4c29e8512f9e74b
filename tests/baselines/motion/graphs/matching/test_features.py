"""Features of frames: what they are, and that they do not depend on where the body stands."""

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.graphs.matching.features import (
    FUTURE,
    LIMBS,
    clip_features,
    feature_groups,
    seen_from,
    steady_heading,
)

AHEAD = (0.2, 0.5)


@pytest.fixture(scope="module")
def walk() -> Clip:
    """From the first lift-off to the last touchdown, 47 cm ahead, as fast as people go."""
    return read_bvh(find_bvh("humanoid_walk")).clip.cut(1.4, 6.5).at_speed(3.0)


def columns(table: np.ndarray, name: str) -> np.ndarray:
    begin = 0
    for group in feature_groups(AHEAD):
        if group.name == name:
            return table[:, begin : begin + group.size]
        begin += group.size
    raise KeyError(name)


def test_turned_and_moved_clips_have_the_same_features(walk: Clip) -> None:
    moved = walk.turned(2.1).moved(np.array([3.0, -4.0, 0.0]))
    assert clip_features(moved, AHEAD) == pytest.approx(clip_features(walk, AHEAD), abs=1e-9)


def test_every_column_has_a_group(walk: Clip) -> None:
    table = clip_features(walk, AHEAD)
    assert table.shape == (len(walk), sum(group.size for group in feature_groups(AHEAD)))
    assert [group.name for group in feature_groups(AHEAD)][-4:] == [
        "place@0.2", "direction@0.2", "place@0.5", "direction@0.5",
    ]  # fmt: skip
    assert len(feature_groups(AHEAD)) == 5 + len(AHEAD) * len(FUTURE)


def test_velocities_are_seen_from_the_facing_frame(walk: Clip) -> None:
    """A walk goes forward; the speed is that of the root, whatever the frame."""
    table = clip_features(walk, AHEAD)
    velocity = columns(table, "velocity")
    true = np.gradient(walk.places()[:, 0], walk.dt, axis=0)
    assert np.linalg.norm(velocity, axis=1) == pytest.approx(np.linalg.norm(true, axis=1))
    gone = walk.root[-1, 0] - walk.root[0, 0]
    assert velocity[:, 0].mean() == pytest.approx(gone / walk.duration, rel=0.05) and gone > 0.4
    assert abs(velocity[:, 1].mean()) < 0.05
    heading = steady_heading(walk)
    assert columns(table, "turning")[:, 0] == pytest.approx(np.gradient(heading, walk.dt))


def test_limbs_are_where_they_are_about_the_place_below_the_root(walk: Clip) -> None:
    """Heights and distances are the world's; left ones are to the left."""
    limbs = columns(clip_features(walk, AHEAD), "limbs").reshape(len(walk), -1, 3)
    places = walk.places()
    for i, role in enumerate(LIMBS):
        true = places[:, walk.skeleton.roles[role]]
        assert limbs[:, i, 2] == pytest.approx(true[:, 2])
        across = np.linalg.norm((true - places[:, 0])[:, :2], axis=1)
        assert np.linalg.norm(limbs[:, i, :2], axis=1) == pytest.approx(across)
        assert (limbs[:, i, 1].mean() > 0.0) == role.endswith("left")


def test_limb_velocities_are_the_worlds(walk: Clip) -> None:
    """A planted foot is at rest, though the body passes over it."""
    table = clip_features(walk, AHEAD)
    speeds = np.linalg.norm(columns(table, "limb_velocities").reshape(len(walk), -1, 3), axis=2)
    planted = columns(table, "contacts").astype(bool)
    feet = speeds[:, [LIMBS.index("ankle_left"), LIMBS.index("ankle_right")]]
    in_the_air = 5 * 0.7 / (2 * 7.9)  # five steps of 0.7 s
    assert planted.mean() == pytest.approx(1.0 - in_the_air, abs=0.05)
    assert np.median(feet[planted]) < 0.3 * np.median(feet[~planted])


def test_the_future_is_where_the_clip_goes(walk: Clip) -> None:
    """The place ahead, put into the world, is the root's then; past the end it is the end's."""
    table, steps = clip_features(walk, AHEAD), round(0.5 / walk.dt)
    heading, root = steady_heading(walk), walk.places()[:, 0, :2]
    place, direction = columns(table, "place@0.5"), columns(table, "direction@0.5")
    for frame in (0, 17, len(walk) - 5):
        then = min(frame + steps, len(walk) - 1)
        c, s = np.cos(heading[frame]), np.sin(heading[frame])
        world = root[frame] + np.array([[c, -s], [s, c]]) @ place[frame]
        assert world == pytest.approx(root[then])
        turn = np.arctan2(*direction[frame, ::-1])
        assert turn == pytest.approx(heading[then] - heading[frame])


def test_a_fast_walk_goes_ahead_in_its_steady_frame() -> None:
    """Hips sway by ± 5° and more; with the sway in the heading the place 1 s ahead of a straight
    walk would go from left to right by a tenth of the way."""
    clip = read_bvh(find_bvh("humanoid_gaits")).clip.cut(13.5, 17.5)  # 1.2 m/s
    sway = np.unwrap(clip.facing()) - steady_heading(clip)
    assert np.degrees(np.ptp(sway)) > 10.0
    inner = slice(20, -20)  # the filter's ends lean on the clip's
    assert np.degrees(np.ptp(steady_heading(clip)[inner])) < 4.0
    root = clip.root[30:] - clip.root[:-30]
    steady = seen_from(steady_heading(clip)[:-30], root)
    swaying = seen_from(np.unwrap(clip.facing())[:-30], root)
    assert steady[:, 0].mean() == pytest.approx(1.2, abs=0.1)
    assert steady[:, 1].std() < 0.5 * swaying[:, 1].std()
