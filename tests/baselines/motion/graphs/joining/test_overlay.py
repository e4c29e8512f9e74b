"""Overlay: identities that it must have, how it comes and goes, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.link_groups import GROUPS, LinkGroup
from poise.baselines.motion.clips.rotations import angle_between
from poise.baselines.motion.graphs.joining.overlay import Layer, overlay
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from tests.support.refused import invalid, refused

ARMS = (GROUPS["arms"],)


@pytest.fixture(scope="module")
def clips() -> tuple[Clip, Clip]:
    """A squat of 3.6 s and 2.6 s of punching."""
    punch = read_bvh(find_bvh("humanoid_punch")).clip
    return read_bvh(find_bvh("humanoid_squat")).clip, punch.cut(0.0, 2.6)


def held(clip: Clip, frame: int = 0) -> Clip:
    return replace(clip, rotations=np.repeat(clip.rotations[frame : frame + 1], len(clip), axis=0))


def test_a_layer_over_itself_or_without_weight_changes_nothing(clips: tuple[Clip, Clip]) -> None:
    base, over = clips
    for layer in (Layer(base), Layer(base, ARMS), Layer(over, weight=0.0),
                  Layer(held(over), additive=True)):  # fmt: skip
        assert angle_between(overlay(base, [layer]).rotations, base.rotations).max() < 1e-7
    assert angle_between(overlay(base, [Layer(over)]).rotations, base.rotations).max() > 0.5


def test_inside_the_layer_has_its_joints_and_the_base_all_others(
    clips: tuple[Clip, Clip],
) -> None:
    """From the blend's end on the arm is the layer's at its own time; outside nothing changes."""
    base, over = clips
    made = overlay(base, [Layer(over, ARMS, start=0.5, blend=0.2)])
    chosen = ARMS[0].joints(base.skeleton)
    others = np.setdiff1d(np.arange(len(base.skeleton.names)), chosen)
    inside = slice(round(0.7 / base.dt) + 1, round(2.9 / base.dt))
    begin = round(0.5 / base.dt)
    theirs = over.rotations[inside.start - begin : inside.stop - begin]
    assert angle_between(made.rotations[inside][:, chosen], theirs[:, chosen]).max() < 1e-6
    assert np.array_equal(made.rotations[:, others], base.rotations[:, others])
    assert np.array_equal(made.root, base.root) and len(made) == len(base)
    for part in (slice(0, begin + 1), slice(round(3.1 / base.dt) + 1, None)):
        assert angle_between(made.rotations[part], base.rotations[part]).max() < 1e-7


def test_the_default_joints_leave_root_and_legs_to_the_base(clips: tuple[Clip, Clip]) -> None:
    base, over = clips
    legs = [0, *GROUPS["legs"].joints(base.skeleton)]
    made = overlay(base, [Layer(over)])
    moved = angle_between(made.rotations, base.rotations).max(axis=0)
    assert moved[legs].max() < 1e-12 and (np.delete(moved, legs) > 1e-3).mean() > 0.5


def test_weights_and_blends_are_shares_of_the_way(clips: tuple[Clip, Clip]) -> None:
    """Between postures that are held the angle is w α(u) of the whole; blending has no jump."""
    base, over = held(clips[0]), held(clips[1], 30)
    made = overlay(base, [Layer(over, ARMS, weight=0.4, blend=1.0)])
    joint = int(ARMS[0].joints(base.skeleton)[1])
    whole = float(angle_between(base.rotations[0, joint], over.rotations[0, joint]))
    gone = angle_between(made.rotations[:, joint], base.rotations[:, joint]) / whole
    until_end = np.minimum(base.times, over.duration - base.times)
    assert gone == pytest.approx(0.4 * ease(np.clip(until_end, 0.0, 1.0)), abs=1e-6)
    assert gone.max() == pytest.approx(0.4) and whole > 0.1


def test_additive_on_its_own_first_posture_is_the_clip(clips: tuple[Clip, Clip]) -> None:
    over = clips[1]
    made = overlay(held(over), [Layer(over, ARMS, additive=True, blend=0.1)])
    inside, chosen = slice(10, -10), ARMS[0].joints(over.skeleton)
    gap = angle_between(made.rotations[inside][:, chosen], over.rotations[inside][:, chosen])
    assert gap.max() < 1e-6


def test_with_weights_the_later_layer_is_above(clips: tuple[Clip, Clip]) -> None:
    base, over = clips
    both = overlay(base, [Layer(over, ARMS, 1.0), Layer(base, ARMS, 1.0)])
    assert angle_between(both.rotations[20:60], base.rotations[20:60]).max() < 1e-6


def test_what_is_refused(clips: tuple[Clip, Clip]) -> None:
    base, over = clips
    with invalid("overlay"):
        overlay(base, [Layer(over, ARMS), Layer(over, ARMS, 0.5, start=1.0)])
    overlay(base.repeated(2), [Layer(over, ARMS), Layer(over, ARMS, start=3.1)])  # not at a time
    with invalid("on"):
        overlay(base, [Layer(over, (GROUPS["left_leg"],))])
    with pytest.raises(ConfigError, match=f"keeps its root and legs: {base.skeleton.names[0]!r}"):
        overlay(base, [Layer(over, (LinkGroup(include=("*",)),))])
    with refused("range", "overlay.weight", least=0, most=1, value="1.5"):
        overlay(base, [Layer(over, ARMS, 1.5)])
    with invalid("overlay.start", "3.6 s"):
        overlay(base, [Layer(over, ARMS, start=9.0)])
    with refused("range", "overlay.blend", above=0):
        overlay(base, [Layer(over, ARMS, blend=0.0)])
    skeleton = replace(over.skeleton, offsets=2.0 * over.skeleton.offsets)
    other = replace(over, skeleton=skeleton)
    with invalid("overlay", "'humanoid_squat'"):
        overlay(base, [Layer(other)])
