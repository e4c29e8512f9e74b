"""Transitions of clips: what they cost, where they are, which are refused, and the file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.graphs.adjacency import (
    end_to_begin,
    make_graph,
    transitions_between,
    with_clip,
)
from poise.baselines.motion.graphs.frames import all_rates, frames_of
from poise.baselines.motion.graphs.joining.coefficient import (
    best_duration,
    coefficient,
    moved_shares,
)
from poise.baselines.motion.graphs.joining.joins import ends
from poise.baselines.motion.graphs.joining.states import state_at
from poise.baselines.motion.graphs.motion_graph import (
    GraphClip,
    MotionGraph,
    StatePlace,
    Thresholds,
    Transition,
    Weight,
    earliest_part,
    latest_part,
    read_graph,
    write_graph,
)
from poise.configs.errors import ConfigError
from tests.support.refused import invalid

OPEN = Thresholds(coefficient=1e9, angle=180.0, contacts=False)
NAMES = ("stand", "squat", "punch", "walk")


@pytest.fixture(scope="module")
def clips() -> dict[str, Clip]:
    return {name: read_bvh(find_bvh(f"humanoid_{name}")).clip for name in NAMES}


def entry(name: str, clip: Clip) -> GraphClip:
    return GraphClip(name, f"humanoid_{name}", clip.duration)


def graph_of(clips: dict[str, Clip], **settings) -> MotionGraph:
    return make_graph([(entry(name, clip), clip) for name, clip in clips.items()], **settings)


def test_rates_are_those_of_states(clips: dict[str, Clip]) -> None:
    for clip in (clips["punch"], clips["punch"].cut(0.0, 1.0 / 30.0)):
        rates = all_rates(clip)
        for frame in {0, 1, len(clip) // 2, len(clip) - 1} & set(range(len(clip))):
            assert rates[frame] == pytest.approx(state_at(clip, frame).rate, abs=1e-9)


def test_the_coefficient_of_ends_is_that_of_a_join(clips: dict[str, Clip]) -> None:
    """Wherever B stands and faces; but going on at one speed over the ground costs nothing."""
    a, b = clips["squat"], clips["punch"].turned(1.0).moved(np.array([3.0, 1.0, 0.0]))
    made = end_to_begin(frames_of(a), frames_of(b), OPEN)
    gap, before, after = ends(a, b)
    half = 0.5 * (after[:2] - before[:2])
    before[:2], after[:2] = -half, half
    masses = moved_shares(a.skeleton)
    best = best_duration(gap, before, after, masses, 0.2, 2.0, OPEN.time_price)
    assert (made.leave, made.enter) == (pytest.approx(a.duration), 0.0)
    assert made.duration == pytest.approx(best.duration)
    assert made.coefficient == pytest.approx(best.coefficient, rel=1e-9)
    assert made.coefficient == pytest.approx(
        float(coefficient(gap, before, after, masses, made.duration)), rel=1e-9
    )


def test_the_minima_are_those_of_all_pairs(clips: dict[str, Clip]) -> None:
    """Against K of every pair, one by one: each transition but the first two is the least about."""
    before, after = (frames_of(clips[name], 0.2) for name in ("squat", "punch"))
    limits = replace(OPEN, each=30)
    found, _ = transitions_between(before, after, limits)
    table = np.full((len(before.times), len(after.times)), np.inf)
    for i in range(2, len(before.times)):
        for j in range(len(after.times) - 2):
            parts = [part._replace(times=part.times[[k, k]], heights=part.heights[[k, k]],
                                   rotations=part.rotations[[k, k]], rates=part.rates[[k, k]])
                     for part, k in ((before, i), (after, j))]  # fmt: skip
            made = end_to_begin(*parts, limits)
            table[i, j] = made.coefficient + limits.time_price * made.duration
    least = np.unravel_index(np.argmin(table), table.shape)
    places = [(int(np.argmin(abs(before.times - t.leave))), int(np.argmin(abs(
        after.times - t.enter)))) for t in found]  # fmt: skip
    assert min(abs(i - least[0]) + abs(j - least[1]) for i, j in places) <= 1
    for i, j in places[2:]:
        about = table[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        assert table[i, j] <= 1.1 * about.min()
    assert len(places) >= 5


def test_transitions_keep_apart_and_one_plays_both_clips(clips: dict[str, Clip]) -> None:
    frames = {name: frames_of(clip) for name, clip in clips.items()}
    limits = replace(OPEN, each=20)
    found, _ = transitions_between(frames["squat"], frames["punch"], limits)
    for i, a in enumerate(found[2:]):
        for b in found[2:][:i]:
            assert max(abs(a.leave - b.leave), abs(a.enter - b.enter)) >= 1.0 / 3.0 - 1e-9
    whole = [t for t in found if t.leave >= latest_part(clips["squat"].duration)
             and t.enter <= earliest_part(clips["punch"].duration)]  # fmt: skip
    assert len(whole) >= 2
    cheapest = min(t.coefficient + limits.time_price * t.duration for t in whole)
    assert cheapest < 20.0
    selves, _ = transitions_between(frames["punch"], frames["punch"], limits)
    assert all(abs(t.leave - t.enter) >= 1.0 for t in selves)


def test_thresholds_refuse_with_the_reason(clips: dict[str, Clip]) -> None:
    """The bottom of a squat and a punch: both clips begin and end standing."""
    a, b = frames_of(clips["squat"].cut(1.2, 2.4)), frames_of(clips["punch"].cut(0.9, 1.7))
    for limits, said in (
        (replace(OPEN, coefficient=0.5), r"^K = \d.*> 0\.5$"),
        (replace(OPEN, angle=2.0), r"^\w+ turns by \d+° > 2°$"),
    ):
        found, reason = transitions_between(a, b, limits)
        assert found == []
        with pytest.raises(AssertionError, match=said):
            raise AssertionError(reason)
    stands = a._replace(planted=np.ones((len(a.times), 2), bool))
    hangs = b._replace(planted=np.zeros((len(b.times), 2), bool))
    contacts = replace(OPEN, contacts=True)
    assert transitions_between(stands, hangs, contacts) == ([], "other feet are planted")
    assert transitions_between(stands, hangs._replace(planted=None), contacts)[0]


def test_a_graph_and_what_an_expert_says(clips: dict[str, Clip]) -> None:
    two = {name: clips[name] for name in ("stand", "squat")}
    limits = Thresholds(coefficient=1e-6)
    never = graph_of(two, thresholds=limits)
    assert never.transitions == () and len(never.refused) == 4
    weights = (Weight("stand", "squat", 2.0), Weight("squat", "stand", None))
    said = graph_of(two, thresholds=limits, weights=weights)
    (only,) = said.transitions
    assert (only.before, only.after, only.enter) == ("stand", "squat", 0.0)
    assert said.cost(only) == pytest.approx(2.0 * only.coefficient + 5.0 * only.duration)
    assert ("squat", "stand", "never, by the expert's weights") in said.refused
    assert said.between("stand", "squat") == (only,) and said.between("squat", "stand") == ()
    with invalid(None, "'jump'", source="graph"):
        graph_of(two, weights=[Weight("stand", "jump", 1.0)])
    longer = replace(two["stand"].skeleton, offsets=2.0 * two["stand"].skeleton.offsets)
    other = replace(two["stand"], skeleton=longer)
    with invalid("clips", "'stand'", source="wave"):
        graph_of({**two, "wave": other})


def test_a_clip_that_comes_later_has_the_same_transitions(clips: dict[str, Clip]) -> None:
    names = ("stand", "squat", "punch")
    frames = {name: frames_of(clips[name])._replace(name=name) for name in names}
    two = graph_of({name: clips[name] for name in names[:2]})
    later = with_clip(two, entry("punch", clips["punch"]), frames)
    whole = graph_of({name: clips[name] for name in names})
    assert set(later.transitions) == set(whole.transitions)
    assert sorted(later.refused) == sorted(whole.refused) and later.names == whole.names


def test_a_graph_s_file_says_all_of_it(clips: dict[str, Clip], tmp_path: Path) -> None:
    states = {"upright": StatePlace("stand", 0.5)}
    graph = graph_of(clips, states=states, weights=[Weight("punch", "squat", 1.5)])
    path = tmp_path / "graph.yaml"
    write_graph(graph, path)
    again = read_graph(path)
    assert again.clips == graph.clips and again.states == states
    assert (again.weights, again.refused) == (graph.weights, graph.refused)
    assert len(again.transitions) == len(graph.transitions) > 20
    for a, b in zip(again.transitions, graph.transitions, strict=True):
        assert (a.before, a.after) == (b.before, b.after)
        assert a.leave == pytest.approx(b.leave, abs=1e-6)
        assert a.coefficient == pytest.approx(b.coefficient, abs=1e-6)
    write_graph(again, tmp_path / "again.yaml")
    assert (tmp_path / "again.yaml").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("robot: ''", "robots: ''", "robots: unknown field"),
        ("coefficient: 20.0", "coefficient: 0", "thresholds.coefficient: must be above 0"),
        ("least: 0.2", "least: 3.0", "thresholds: least 3 s is more than most 2 s"),
        ("- [stand, squat, ", "- [stand, jump, ", "no clip is called 'jump'"),
        ("- [stand, squat, ", "- [stand, squat, 9", "a time of 'stand' → 'squat' is not in it"),
        ("- name: squat", "- name: stand", "clips: 'stand' occurs twice"),
        ("transitions:", "transitions:\n- [stand, squat, 0.1]", "transitions[0]: must be a list"),
        ("time: 0.5", "time: 50.0", "states: 'upright' is not in the clip 'stand'"),
    ],
)
def test_wrong_files_are_one_line(
    old: str, new: str, said: str, clips: dict[str, Clip], tmp_path: Path
) -> None:
    two = {name: clips[name] for name in ("stand", "squat")}
    path = tmp_path / "graph.yaml"
    write_graph(graph_of(two, states={"upright": StatePlace("stand", 0.5)}), path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        read_graph(path)
    assert str(caught.value).startswith(f"{path}: ") and said in str(caught.value)


def test_what_a_transition_must_be() -> None:
    clip = GraphClip("a", "a.bvh", 2.0)
    for broken in (Transition("a", "a", 1.0, 0.0, 0.0, 1.0), Transition("a", "a", 1.0, 0, 1.0, -1)):
        with pytest.raises(ValueError, match="lasts or costs less than nothing"):
            MotionGraph("", Thresholds(), (clip,), transitions=(broken,))
    with pytest.raises(ConfigError, match="must be the name of a .yaml file"):
        write_graph(MotionGraph("", Thresholds(), (clip,)), "graph.txt")
