"""From a script to a clip: what is played when, what is derived, and what is refused where."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.link_groups import GROUPS
from poise.baselines.motion.clips.rotations import angle_between
from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.frames import frames_of, nearest_places
from poise.baselines.motion.graphs.joining.joins import JOINS
from poise.baselines.motion.graphs.moments import strong_clips
from poise.baselines.motion.graphs.motion_graph import GraphClip, MotionGraph, StatePlace
from poise.baselines.motion.synthesis.scripts.library import between, find_script, packaged_scripts
from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.synthesis import Synthesis
from poise.configs.errors import ConfigError

NAMES = ("humanoid_stand", "humanoid_squat", "humanoid_punch", "humanoid_reach_up", "humanoid_walk")


@cache
def clips() -> dict[str, Clip]:
    return {name: read_bvh(find_bvh(name)).clip for name in NAMES}


@cache
def graph() -> MotionGraph:
    entries = [(GraphClip(name, name, clip.duration), clip) for name, clip in clips().items()]
    return make_graph(entries, states={"upright": StatePlace("humanoid_stand", 0.5)})


def make(text: str, **settings) -> tuple[Clip, dict[str, Any]]:
    return Synthesis(graph(), clips(), **settings).make(parse(text, "try.motion"))


def wanted(record: dict[str, Any]) -> list[str]:
    return [part["what"] for part in record["parts"] if part["wanted"]]


def test_clips_are_played_in_order_and_the_record_says_when() -> None:
    """Each part of the whole is the clip that the record names there, but for place and heading."""
    made, record = make("squat -> punch")
    assert wanted(record) == ["humanoid_squat", "humanoid_punch"]
    played = record["parts"]
    assert played[0]["begins"] == 0.0 and played[-1]["ends"] == pytest.approx(made.duration)
    for before, after in pairwise(played):
        assert after["begins"] == pytest.approx(before["ends"])
    for part in (part for part in played if part["coefficient"] is None):
        own = clips()[part["what"]].cut(part["enter"], part["leave"])
        there = made.cut(part["begins"], part["ends"])
        assert len(own) == len(there)
        assert angle_between(own.rotations[:, 1:], there.rotations[:, 1:]).max() < 1e-6
    assert record["duration"] == made.duration and record["cost"] > 0.0


def test_no_step_between_frames_is_larger_than_the_clips_own_by_much() -> None:
    made, _ = make("squat -> punch -> reach_up * 2 -> stand")
    steps = angle_between(made.rotations[:-1], made.rotations[1:]).max()
    own = max(angle_between(clip.rotations[:-1], clip.rotations[1:]).max()
              for clip in clips().values())  # fmt: skip
    assert steps < 1.5 * own
    assert np.linalg.norm(np.diff(made.root, axis=0), axis=1).max() < 0.08


def test_the_same_script_gives_the_same_clip() -> None:
    text = "a = squat | punch on arms; a -> stand"
    first, second = make(text), make(text)
    assert np.array_equal(first[0].rotations, second[0].rotations)
    assert np.array_equal(first[0].root, second[0].root) and first[1] == second[1]


def test_transitions_by_hand_are_those_of_the_joins() -> None:
    """From end to begin, of the kind and duration that the script says; nothing in between."""
    a, b = clips()["humanoid_squat"], clips()["humanoid_punch"]
    for kind in JOINS:
        made, record = make(f"squat ->{{{kind}, 0.5}} punch")
        own = JOINS[kind](a, b, 0.5)
        assert np.array_equal(made.rotations, own.rotations)
        assert [part["what"] for part in record["parts"]] == [a.name, kind, b.name]
    made, record = make("squat ->{insert} punch -> stand", kind="inertial")
    kinds = [part["what"] for part in record["parts"] if part["coefficient"] is not None]
    assert kinds[0] == "insert" and set(kinds[1:]) == {"inertial"}


def test_definitions_brackets_and_repetitions() -> None:
    _, record = make("pair = squat -> stand * 2; (pair -> punch) * 2 -> pair")
    order = [name.removeprefix("humanoid_") for name in wanted(record)]
    assert order == ["squat", "stand", "stand", "punch"] * 2 + ["squat", "stand", "stand"]


def test_a_definition_sees_those_before_it_alone() -> None:
    """So a name may stand for more of the clip of that name."""
    _, record = make("squat = squat -> stand; punch = squat -> punch; punch")
    assert wanted(record) == ["humanoid_squat", "humanoid_stand", "humanoid_punch"]
    _, record = make('stand = squat; "stand" -> stand')
    assert wanted(record) == ["humanoid_stand", "humanoid_squat"]


def test_quoted_names_are_defined_apart_from_bare_ones() -> None:
    _, record = make('"сесть" = squat -> stand; сесть = punch; "сесть" -> сесть')
    assert [name.split("_")[-1] for name in wanted(record)] == ["squat", "stand", "punch"]


def test_modifiers_are_what_clips_do() -> None:
    made, record = make("squat[1:3]@0.5 mirrored")
    own = clips()["humanoid_squat"].cut(1.0, 3.0).at_speed(0.5).mirrored()
    assert angle_between(made.rotations, own.rotations).max() < 1e-9
    assert made.skeleton.same_as(clips()["humanoid_squat"].skeleton)
    assert record["made"] == ["squat [1:3] @ 0.5 mirrored"]
    backwards, _ = make("squat@0.5[1:3]")
    assert backwards.duration == pytest.approx(2.0) and made.duration == pytest.approx(4.0)


def test_an_overlay_has_the_base_s_legs_and_the_layer_s_arms() -> None:
    made, record = make("squat | punch on arms weight 1")
    base, over = clips()["humanoid_squat"], clips()["humanoid_punch"]
    legs, arms = (GROUPS[name].joints(base.skeleton) for name in ("legs", "arms"))
    middle = slice(20, 85)
    assert np.array_equal(made.rotations[:, legs], base.rotations[:, legs])
    assert (
        angle_between(made.rotations[middle][:, arms], over.rotations[middle][:, arms]).max() < 1e-6
    )
    assert wanted(record) == ["squat | punch on arms weight 1"]
    longer, _ = make("(squat -> stand) | (punch[1:3] * 2) on right_arm")
    assert longer.duration > base.duration + 0.5


def test_start_and_goal_are_postures() -> None:
    made, record = make("<upright> -> squat -> <upright>")
    upright = clips()["humanoid_stand"].rotations[15]
    for frame in (0, -1):
        gap = angle_between(made.rotations[frame, 1:], upright[1:])
        assert np.degrees(gap.max()) < 20.0 and np.degrees(np.sqrt((gap**2).mean())) < 6.0
    assert wanted(record) == ["humanoid_squat"]
    begun, record = make("<squat> -> punch")  # how a clip begins
    gap = angle_between(begun.rotations[0, 1:], clips()["humanoid_squat"].rotations[0, 1:])
    assert np.degrees(np.sqrt((gap**2).mean())) < 12.0 and wanted(record) == ["humanoid_punch"]


def rests(made: Clip, record: dict[str, Any]) -> list[np.ndarray]:
    """Rotations of the frames in the middle of each posture that was wanted."""
    held = [part for part in record["parts"] if part["wanted"] and part["what"].startswith("<")]
    middle = [round(0.5 * (part["begins"] + part["ends"]) / made.dt) for part in held]
    return [made.rotations[frame, 1:] for frame in middle]


def test_postures_in_the_middle_are_met() -> None:
    """Exactly, at rest, in their order; motions are found between, also clips that nobody named."""
    texts = ["<upright>", "<squat @ 1.8>", "<punch @ 2>", "<upright>"]
    frames = [("stand", 15), ("squat", 54), ("punch", 60), ("stand", 15)]
    asked = [clips()[f"humanoid_{name}"].rotations[i, 1:] for name, i in frames]
    made, record = make(" -> ".join(texts))  # of postures alone the first and last are met, too
    assert wanted(record) == texts
    for met, posture in zip(rests(made, record), asked, strict=True):
        assert angle_between(met, posture).max() < 1e-6
    made, record = make("squat -> <punch @ 2> -> squat")
    assert wanted(record) == ["humanoid_squat", "<punch @ 2>", "humanoid_squat"]
    assert angle_between(rests(made, record)[0], asked[2]).max() < 1e-6
    steps = angle_between(made.rotations[:-1], made.rotations[1:]).max()
    own = max(angle_between(c.rotations[:-1], c.rotations[1:]).max() for c in clips().values())
    assert steps < 1.5 * own  # no leap where a posture is met


def test_nearest_frames() -> None:
    frames = {name: frames_of(clip)._replace(name=name) for name, clip in clips().items()}
    squat = frames["humanoid_squat"]
    found = nearest_places(frames, (squat.heights[10], squat.rotations[10]), near=3.0)
    assert found["humanoid_squat", float(squat.times[10])] == pytest.approx(0.0, abs=1e-6)
    deep = int(np.argmin(squat.heights[:, 2]))
    others = {name: each for name, each in frames.items() if name != "humanoid_squat"}
    with pytest.raises(
        ConfigError, match=r"no clip comes within 8° of it: the nearest is 'humanoid_"
    ):
        nearest_places(others, (squat.heights[deep], squat.rotations[deep]))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("squat ->\n wawe", "line 2, column 2: no motion 'wawe' (choices: humanoid_stand, "),
        ("a = b; a", "line 1, column 5: no motion 'b' (choices: a, humanoid_stand"),
        ("a = a; a", "line 1, column 5: no motion 'a' (choices: a, humanoid_stand"),
        ("squat[1:9]", "line 1, column 6: must be two times within 0 and 3.600 s"),
        ("squat on arms", 'line 1, column 7: "on" is for what lies over another motion'),
        ("squat weight 1 | punch", 'line 1, column 7: "weight" is for what lies over another'),
        ("squat | punch on hat", "line 1, column 15: no link group 'hat' (choices: left_arm, "),
        (
            "squat | punch on legs",
            "line 1, column 9: the base keeps its root and legs: 'LeftUpLeg'",
        ),
        (
            "squat | punch | reach_up",
            "line 1, column 9: 'humanoid_punch' and 'humanoid_reach_up' both",
        ),
        ("<upright> | squat", "line 1, column 1: a posture stands alone"),
        ("<upright>", "line 1, column 1: a script needs a motion or two postures"),
        ("squat -> <squat @ 99> -> punch", "line 1, column 10: 'humanoid_squat' lasts 3.60 s"),
        ("squat -> <upright @ 1> -> punch", "no posture 'upright' (choices: humanoid_stand"),
        (
            "<sitting> -> squat",
            "no posture 'sitting' (choices: upright, humanoid_",
        ),
        ("<upright> ->{cross} squat", "line 1, column 11: next to a first or last posture no"),
        ("squat ->{physical} punch", "line 1, column 7: no transition 'physical' here (choices: "),
        ("squat ->{cross, 60} punch", "cross: lasts 60 s, longer than a clip"),
        ("squat -> ((walk * 90) * 90) * 90", ": more than 1000 actions"),
        ("a=punch*90; b=a*90; b", ": more than 1000 actions"),
        ("a=squat@0.1*90; a | stand", "lasts longer than 600 s"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        make(text)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_without_a_way_the_reason_is_told() -> None:
    none = replace(graph(), transitions=tuple(
        t for t in graph().transitions if t.after != "humanoid_punch"))  # fmt: skip
    none = replace(
        none, refused=(*none.refused, ("humanoid_squat", "humanoid_punch", "K = 41 > 20"))
    )
    told = (r"try\.motion: no way from 'humanoid_squat' to 'humanoid_punch' \(reachable: .*; "
            r"nearest to it: K = 41 > 20\)")  # fmt: skip
    with pytest.raises(ConfigError, match=told):
        Synthesis(none, clips()).make(parse("squat -> punch", "try.motion"))


def test_the_strong_part_goes_on_for_ever() -> None:
    assert set(strong_clips(graph())) <= set(NAMES)
    lonely = replace(graph(), transitions=tuple(
        t for t in graph().transitions if "humanoid_walk" not in (t.before, t.after)))  # fmt: skip
    assert "humanoid_walk" not in strong_clips(lonely)
    assert strong_clips(replace(graph(), transitions=())) == []


def test_settings_that_are_wrong() -> None:
    with pytest.raises(ConfigError, match="kind: no transition 'jump' here"):
        Synthesis(graph(), clips(), kind="jump")
    with pytest.raises(ConfigError, match="graph: the clip 'humanoid_walk' is not loaded"):
        Synthesis(graph(), {name: clips()[name] for name in NAMES[:4]})


def test_packaged_scripts_are_read() -> None:
    assert packaged_scripts() == ["greeting", "semakin04", "warm_up"]
    for name in packaged_scripts():
        assert find_script(name).source.endswith(f"{name}.motion")
    assert find_script("squat -> punch") == parse("squat -> punch")
    with pytest.raises(ConfigError, match="no.motion: cannot be read"):
        find_script("no.motion")


def test_between_postures() -> None:
    script = parse("a = b;  # first\na -> c  # last")
    whole = between(script, "x", "y")
    assert whole == parse("a = b; <x> -> a -> c -> <y>")
    assert between(script, None, None) is script
    assert between(script, None, "y") == parse("a = b; a -> c -> <y>")
