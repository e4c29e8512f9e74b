"""Frames between keyframes by name: the keys stay, speeds are what the kind says."""

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.rotations import angle_between
from poise.baselines.motion.graphs.joining.keyframes import KINDS, between_keyframes
from poise.baselines.motion.graphs.joining.states import minus
from poise.configs.errors import ConfigError

KEYS = np.array([3, 12, 20, 41, 50])


@pytest.fixture(scope="module")
def clip() -> Clip:
    return read_bvh(find_bvh("humanoid_punch")).clip


def fine(clip: Clip, kind: str, by: int = 40) -> tuple[Clip, np.ndarray]:
    """The keys of a clip at `by` times its rate, and their numbers there."""
    dense = clip.resampled(clip.dt / by)
    keys = KEYS * by
    keys = keys - keys[0]
    return between_keyframes(dense, keys + KEYS[0] * by, kind), keys


@pytest.mark.parametrize("kind", KINDS)
def test_keyframes_stay_and_the_rest_is_near(clip: Clip, kind: str) -> None:
    filled = between_keyframes(clip, KEYS, kind)
    assert len(filled) == KEYS[-1] - KEYS[0] + 1
    at = KEYS - KEYS[0]
    assert filled.root[at] == pytest.approx(clip.root[KEYS], abs=1e-12)
    assert angle_between(filled.rotations[at], clip.rotations[KEYS]).max() < 1e-7
    assert np.linalg.norm(filled.rotations, axis=-1) == pytest.approx(1.0)
    original = clip.rotations[KEYS[0] : KEYS[-1] + 1]
    gap = angle_between(filled.rotations, original)
    held = np.searchsorted(KEYS, np.arange(KEYS[0], KEYS[-1] + 1), side="right") - 1
    staying = angle_between(clip.rotations[KEYS[held]], original)
    assert np.sqrt((gap**2).mean()) < 0.7 * np.sqrt((staying**2).mean())


@pytest.mark.parametrize("kind", KINDS)
def test_all_frames_as_keys_are_the_clip(clip: Clip, kind: str) -> None:
    filled = between_keyframes(clip, np.arange(len(clip)), kind)
    assert filled.root == pytest.approx(clip.root, abs=1e-12)
    assert angle_between(filled.rotations, clip.rotations).max() < 1e-7


def rates(clip: Clip) -> np.ndarray:
    """(F − 1, 3 + 3J)."""
    steps = minus(clip.root[1:], clip.rotations[1:], clip.root[:-1], clip.rotations[:-1])
    return steps / clip.dt


def test_slerp_turns_at_constant_speed_and_a_line_of_quaternions_does_not(clip: Clip) -> None:
    for kind, constant in (("slerp", True), ("linear", False)):
        filled, keys = fine(clip, kind, 20)
        speeds = np.linalg.norm(rates(filled)[: keys[1], 3:].reshape(keys[1], -1, 3), axis=-1)
        variation = np.ptp(speeds, axis=0) / speeds.max()
        assert (variation.max() < 1e-6) == constant


@pytest.mark.parametrize(("kind", "smooth"), [("slerp", 0), ("catmull-rom", 1), ("cubic", 2)])
def test_rates_jump_where_the_kind_lets_them(clip: Clip, kind: str, smooth: int) -> None:
    """At the keys, finely sampled: angular velocities for C⁰, accelerations for C¹."""
    filled, keys = fine(clip, kind)
    velocity = rates(filled)
    jumps = np.abs(velocity[keys[1:-1]] - velocity[keys[1:-1] - 1]).max()
    assert (jumps > 0.3) == (smooth < 1)
    bends = (velocity[1:] - velocity[:-1]) / filled.dt
    jumps = np.abs(bends[keys[1:-1]] - bends[keys[1:-1] - 2])[:, 3:].max()
    if smooth:
        assert (jumps > 5.0) == (smooth < 2)


def test_hermite_rests_in_every_keyframe_and_catmull_rom_only_at_the_ends(clip: Clip) -> None:
    for kind, rests in (("hermite", len(KEYS)), ("catmull-rom", 2)):
        filled, keys = fine(clip, kind)
        speed = np.abs(rates(filled)).max(axis=1)
        assert (speed[np.minimum(keys, len(speed) - 1)] < 0.05).sum() == rests


@pytest.mark.parametrize("frames", [[0], [5, 5], [5, 4], [-1, 4], [0, 10_000], [0.5, 2.0], "all"])
def test_what_are_no_frames_is_an_error(clip: Clip, frames) -> None:
    with pytest.raises(ConfigError, match="frames: must be two or more of 0 to"):
        between_keyframes(clip, frames, "slerp")


def test_an_unknown_kind_is_an_error(clip: Clip) -> None:
    with pytest.raises(ConfigError, match="no such kind: 'squad'.*slerp"):
        between_keyframes(clip, KEYS, "squad")
