"""Operations on clips: what must be unchanged, and what must be the other way round."""

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.rotations import angle_between, slerp
from poise.configs.errors import ConfigError
from tests.support.refused import invalid, refused


@pytest.fixture(scope="module")
def walk() -> Clip:
    return read_bvh(find_bvh("humanoid_walk")).clip


def test_mirrored_is_the_mirror_image(walk: Clip) -> None:
    image, partners = walk.mirrored(), walk.skeleton.partners
    assert np.abs(image.places() - walk.places()[:, partners] * [1, -1, 1]).max() < 1e-12
    assert partners[walk.skeleton.roles["knee_left"]] == walk.skeleton.roles["knee_right"]
    assert np.abs(image.mirrored().places() - walk.places()).max() < 1e-12


def test_turned_and_moved_as_a_whole(walk: Clip) -> None:
    turned = walk.turned(0.5 * np.pi).moved(np.array([1.0, 0.0, 0.0])).places()
    old = walk.places()
    assert np.abs(turned - [1, 0, 0] - np.stack([-old[..., 1], old[..., 0], old[..., 2]], -1)
                  ).max() < 1e-12  # fmt: skip
    faced = walk.turned(1.0).faced()
    assert abs(faced.facing()[0]) < 1e-12
    assert faced.root[0, :2] == pytest.approx([0, 0], abs=1e-12)
    assert faced.root[-1, 0] > 0.45  # who walks, walks ahead
    with invalid("turn"):
        walk.turned(np.nan)


def test_cut_speed_and_reverse(walk: Clip) -> None:
    part = walk.cut(0.5, 1.5)
    assert part.duration == pytest.approx(1.0) and np.all(part.root[0] == walk.root[15])
    fast = walk.at_speed(2.0)
    assert fast.dt == walk.dt and fast.duration == pytest.approx(walk.duration / 2, abs=walk.dt)
    assert np.abs(fast.root[7] - walk.root[14]).max() < 1e-12
    assert np.all(walk.reversed().places() == walk.places()[::-1])
    with invalid("cut", "0", "7.9"):
        walk.cut(1.0, 9.0)
    with invalid("cut", "0", "7.9"):
        walk.cut(np.nan, np.inf)
    with refused("range", "speed", above=0):
        walk.at_speed(0.0)


def test_a_clip_has_two_frames_and_no_more_than_a_million(walk: Clip) -> None:
    """Whatever is asked for: one frame could not be read again, and memory has an end."""
    for made, field in (
        (lambda: walk.at_speed(1e3), "speed: must give 2 to 1000000 frames, not 1"),
        (lambda: walk.at_speed(1e-9), "speed: must give 2 to 1000000 frames, not"),
        (lambda: walk.resampled(20.0), "rate: must give 2 to 1000000 frames, not 1"),
        (lambda: walk.resampled(1e-9), "rate: must give 2 to 1000000 frames, not"),
        (lambda: walk.repeated(10**9), "loop: must give 2 to 1000000 frames, not"),
    ):
        with pytest.raises(ConfigError, match=field):
            made()


def test_sampling_is_the_frames_and_slerp_between(walk: Clip) -> None:
    root, turns = walk.sample(walk.times)
    assert np.abs(root - walk.root).max() < 1e-12
    assert angle_between(turns, walk.rotations).max() < 1e-7
    _, middle = walk.sample(np.array([0.5 * walk.dt]))
    whole = angle_between(walk.rotations[0], walk.rotations[1])
    assert angle_between(walk.rotations[0], middle[0]) == pytest.approx(whole / 2, abs=1e-7)


def test_slerp_has_constant_speed_on_the_shorter_way() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 50, 4))
    a, b = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (a, b))
    for u in (0.0, 0.25, 0.7, 1.0):
        way = angle_between(a, slerp(a, b, np.full(50, u)))
        assert np.abs(way - u * angle_between(a, b)).max() < 1e-7
        assert way.max() <= np.pi * u + 1e-7
    line = 0.75 * a + 0.25 * np.where((a * b).sum(axis=1, keepdims=True) < 0.0, -b, b)
    normalised = line / np.linalg.norm(line, axis=1, keepdims=True)
    slow = angle_between(a, normalised) - 0.25 * angle_between(a, b)
    assert slow.max() < 0.0  # a line of quaternions begins slowly


def test_closed_ends_as_it_begins_and_keeps_the_rest(walk: Clip) -> None:
    closed = walk.closed(0.5)
    assert np.abs(closed.places()[-1] - closed.places()[0]).max() < 1e-12
    before = walk.times < walk.duration - 0.5
    assert np.abs(closed.places()[before] - walk.places()[before]).max() < 1e-12


def test_repeated_goes_on_where_it_ended(walk: Clip) -> None:
    """The joints between copies jump as first and last frame differ; place and heading do not."""
    twice = walk.repeated(3)
    assert len(twice) == 3 * len(walk) - 2
    n = len(walk)
    step = walk.root[-1, :2] - walk.root[0, :2]
    assert np.abs(twice.root[n - 1, :2] - walk.root[-1, :2]).max() < 1e-12
    assert np.linalg.norm(twice.root[-1, :2] - twice.root[0, :2]) > 2.5 * np.linalg.norm(step)
    turn = walk.facing()[-1] - walk.facing()[0]
    assert twice.facing()[n - 1 + 5] - walk.facing()[5] == pytest.approx(turn, abs=1e-9)
    with refused("range", "loop", least=1):
        walk.repeated(0)
