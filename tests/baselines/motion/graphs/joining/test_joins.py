"""Joins: where they begin and end, how smooth they are, and identities that they must have."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.rotations import angle_between, exp, from_scipy
from poise.baselines.motion.graphs.joining.joins import (
    JOINS,
    capture,
    cross_fade,
    faced_like,
    hermite,
    insert,
)
from poise.baselines.motion.graphs.joining.states import (
    State,
    minus,
    plus,
    state_at,
    vector_rate,
)
from tests.support.refused import invalid

RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def clips() -> tuple[Clip, Clip]:
    return read_bvh(find_bvh("humanoid_punch")).clip, read_bvh(find_bvh("humanoid_squat")).clip


def random_state(joints: int) -> State:
    rotations = from_scipy(Rotation.random(joints, rng=RNG), (joints,))
    return State(RNG.normal(size=3), rotations, *RNG.normal(size=(2, 3 + 3 * joints)))


def near(state: State) -> State:
    """A random state within about a radian of another one."""
    moved = plus(state.root, state.rotations, RNG.uniform(-0.6, 0.6, len(state.rate)))
    return State(*moved, *RNG.normal(size=(2, len(state.rate))))


def rates(curve, time: float, h: float = 1e-5) -> tuple[np.ndarray, np.ndarray]:
    """Rate and acceleration of a curve of postures at a time, by differences."""
    root, rotations = curve(time + h * np.array([-1.0, 0.0, 1.0]))
    steps = minus(root[1:], rotations[1:], root[:-1], rotations[:-1]) / h
    return steps.mean(axis=0), (steps[1] - steps[0]) / h


def test_rates_of_rotation_vectors_are_those_of_rotations() -> None:
    for size in (1e-6, 0.5, 3.0):
        turn, rate = RNG.normal(size=(2, 20, 3))
        turn *= size / np.linalg.norm(turn, axis=1, keepdims=True)
        h = 1e-6
        moved = minus(np.zeros(3), exp(turn + h * rate), np.zeros(3), exp(turn - h * rate))
        body_rate = moved[3:].reshape(-1, 3) / (2 * h)
        assert vector_rate(turn, body_rate) == pytest.approx(rate, abs=1e-6)


@pytest.mark.parametrize("order", [3, 5])
def test_the_hermite_curve_meets_both_ends(order: int) -> None:
    """500 random pairs: places to 1e-9, rates to 1e-6, with order 5 accelerations to 1e-4."""
    for _ in range(500):
        a = random_state(2)
        b, duration = near(a), float(RNG.uniform(0.3, 1.5))

        def curve(times: np.ndarray, a=a, b=b, duration=duration):
            return hermite(a, b, duration, times, order)

        for time, state in ((0.0, a), (duration, b)):
            root, rotations = curve(np.array([time]))
            assert np.abs(root[0] - state.root).max() < 1e-9
            assert angle_between(rotations[0], state.rotations).max() < 1e-7
            # rates by differences about the end itself: the curve goes on beyond it
            assert rates(curve, time, 1e-5)[0] == pytest.approx(state.rate, abs=1e-6)
            if order == 5:
                assert rates(curve, time, 1e-4)[1] == pytest.approx(state.acceleration, abs=2e-3)


def test_lengths_and_ends(clips: tuple[Clip, Clip]) -> None:
    """T₁ + D + T₂, T₁ + T₂ − D, T₁ + T₂; the first frame is A's, the last posture B's."""
    a, b = clips
    d = 12 * a.dt
    extra = {"insert": d, "cross": -d, "capture": 0.0, "inertial": 0.0}
    for kind, join in JOINS.items():
        whole = join(a, b, d)
        assert whole.duration == pytest.approx(a.duration + b.duration + extra[kind], abs=1e-9)
        assert np.array_equal(whole.root[0], a.root[0])
        last = faced_like(b, a).rotations[-1]
        assert angle_between(whole.rotations[-1], last).max() < 1e-5


@pytest.mark.parametrize("kind", JOINS)
def test_no_join_jumps(kind: str, clips: tuple[Clip, Clip]) -> None:
    """No step between frames is larger than twice the clips' own, where they meet at rest."""
    a, b = clips
    whole = JOINS[kind](a, b, 0.8)
    steps = angle_between(whole.rotations[:-1], whole.rotations[1:]).max()
    own = max(angle_between(c.rotations[:-1], c.rotations[1:]).max() for c in (a, b))
    assert steps < 2.0 * own
    assert np.linalg.norm(np.diff(whole.root, axis=0), axis=1).max() < 0.08


def smooth_clip(like: Clip, frames: int = 361) -> Clip:
    """Every joint swings slowly about its own axis, at 120 frames a second."""
    times, joints = np.arange(frames) / 120.0, len(like.skeleton.names)
    axes = RNG.normal(size=(joints, 3))
    vectors = 0.3 * np.sin(2.0 * times[:, None, None] + axes[:, :1]) * axes
    root = np.stack([0.2 * times, 0.1 * np.sin(times), 1.0 + 0.0 * times], axis=1)
    return replace(like, dt=1.0 / 120.0, root=root, rotations=exp(vectors))


def test_what_fits_already_stays_as_it_is(clips: tuple[Clip, Clip]) -> None:
    """A smooth clip cut in two and captured together again is the clip."""
    whole = smooth_clip(clips[0])
    again = capture(whole.cut(0.0, 1.5), whole.cut(1.5, 3.0), 0.3)
    assert len(again) == len(whole)
    assert angle_between(again.rotations, whole.rotations).max() < 1e-3
    assert np.abs(again.root - whole.root).max() < 1e-4
    assert np.abs(capture(whole.cut(0.0, 1.5), whole.cut(0.0, 1.5), 0.3).root[-1]).max() > 0.5


def test_capture_has_one_rate_at_its_seam(clips: tuple[Clip, Clip]) -> None:
    """On both sides it is the mean rate of the two clips there; the posture is half way."""
    a, b = clips[0].cut(0.0, 3.0).resampled(1e-3), clips[1].cut(0.8, 3.4).resampled(1e-3)
    whole, seam = capture(a, b, 0.6), len(a) - 1
    turned = faced_like(b, a)
    ends = state_at(a, seam), state_at(turned, 0)
    gap = minus(*whole_at(whole, seam), a.root[-1], a.rotations[-1])
    assert gap[3:] == pytest.approx(
        0.5 * minus(a.root[-1], turned.rotations[0], a.root[-1], a.rotations[-1])[3:], abs=1e-9
    )
    before = state_at(part(whole, slice(0, seam + 1)), seam)
    after = state_at(part(whole, slice(seam, None)), 0)
    mean = 0.5 * (ends[0].rate + ends[1].rate)
    scale = np.abs(mean).max()
    assert np.abs(before.rate - after.rate).max() < 0.02 * scale
    assert np.abs(before.rate - mean).max() < 0.02 * scale


def part(clip: Clip, frames: slice) -> Clip:
    return replace(clip, root=clip.root[frames], rotations=clip.rotations[frames])


def whole_at(clip: Clip, frame: int) -> tuple[np.ndarray, np.ndarray]:
    return clip.root[frame], clip.rotations[frame]


def test_cross_is_linear_on_request(clips: tuple[Clip, Clip]) -> None:
    """Between two clips that stand still, slerp has a constant speed to 1e-9."""
    first = [part(clip, slice(i, i + 1)) for clip, i in zip(clips, (0, 60), strict=True)]
    still = [replace(c, root=c.root.repeat(40, 0), rotations=c.rotations.repeat(40, 0))
             for c in first]  # fmt: skip
    whole = cross_fade(*still, 20 * still[0].dt, "linear")
    steps = angle_between(whole.rotations[19:39], whole.rotations[20:40])
    assert np.ptp(steps, axis=0).max() < 1e-7
    assert steps.max() > 1e-3
    smooth = cross_fade(*still, 20 * still[0].dt)
    assert angle_between(smooth.rotations[19], smooth.rotations[20]).max() < 0.1 * steps.max()


def test_errors_name_the_kind(clips: tuple[Clip, Clip]) -> None:
    a, b = clips
    with invalid("insert", "2", "0.0667 s"):
        insert(a, b, 0.01)
    with invalid("cross", "100 s"):
        cross_fade(a, b, 100.0)
    other = replace(a, skeleton=replace(a.skeleton, offsets=2.0 * a.skeleton.offsets))
    with invalid("capture"):
        capture(a, other, 0.5)
