"""Pictures of graphs, scripts and performances: what is drawn is what the data hold."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.motion.feasibility.check import check_motion
from poise.baselines.motion.graphs.motion_graph import (
    GraphClip,
    MotionGraph,
    Thresholds,
    Transition,
)
from poise.training.motion.following.follow import follow
from poise.training.pictures.figures.motion_graph import best_coefficients, plot_graph
from poise.training.pictures.motion_report.over_time import errors_picture, zmp_picture
from poise.training.pictures.motion_report.page import check_page, write_page
from poise.training.pictures.motion_report.performance import Watched, graph_pictures
from poise.training.pictures.motion_report.timeline import layers_of, timeline_picture
from tests.support.drawings import drawing, groups, marks, middle, points
from tests.support.physics import robot_named
from tests.support.refused import invalid
from tests.support.robot_clips import ahead_clip

NAMES = ("stand", "squat <deep>", "walk")
GRAPH = MotionGraph(
    "", Thresholds(), tuple(GraphClip(name, "", 3.0) for name in NAMES),
    transitions=(Transition("stand", NAMES[1], 3.0, 0.0, 0.4, 8.0),
                 Transition("stand", NAMES[1], 2.0, 0.0, 0.2, 2.0),
                 Transition(NAMES[1], "stand", 3.0, 0.0, 0.2, 0.0)),
    refused=((NAMES[1], "walk", "other feet are planted"), ("stand", "walk", "K = 41 > 20"),
             ("walk", "stand", "never, by the expert's weights"),
             ("walk", "walk", "knee turns by 140° > 120°")),
)  # fmt: skip


def test_the_matrix_has_every_pair_and_the_reasons() -> None:
    """Deeper is the smaller K; a pair that is refused has the mark of its reason and its words."""
    table = best_coefficients(GRAPH)
    assert table[0, 1] == 2.0 and table[1, 0] == 0.0 and np.isnan(table[0, 2])
    matrix, _ = graph_pictures(GRAPH)
    cells = [p for p in drawing(matrix.out.svg).iter("path") if p.get("stroke") == "var(--card)"]
    depth = {p.get("fill-opacity") for p in cells if p.get("fill") == "var(--s0)"}
    assert len(cells) == 9 and depth == {"0.6", "0.1"}
    told = marks(matrix.out, "")
    assert "squat <deep> → walk: other feet are planted" in told and len(told) == 7
    kinds = {
        re.sub(r"[^-\d]+", "", str(np.round(points(p) - middle(p)) + 0.0)) for p in told.values()
    }
    assert len(kinds) == 4
    assert len(matrix.key) == 4 and "K is too large" in matrix.key


def test_the_circle_names_every_clip_and_has_an_arrow_for_each_pair() -> None:
    _, circle = graph_pictures(GRAPH)
    root = drawing(circle.out.svg)
    assert {e.text for e in root.iter("text")} == set(NAMES)
    assert {e.text for e in root.iter("title")} == {
        "stand → squat <deep>: K = 2", "squat <deep> → stand: K = 0"
    }  # fmt: skip
    nodes = [p for p in root.iter("path") if p.get("fill") == "var(--card)"]
    assert [p.get("stroke-dasharray") is not None for p in nodes] == [False, False, True]


def test_a_png_has_both_parts(tmp_path: Path) -> None:
    """The same drawings side by side."""
    plot_graph(tmp_path / "a.png", GRAPH)
    height, width, _ = imread(tmp_path / "a.png").shape
    assert width == 2 * height


def test_without_any_transition_there_is_still_a_picture() -> None:
    alone = replace(GRAPH, transitions=())
    assert [p.title for p in graph_pictures(alone)] == ["Which clip may follow which", "The graph"]


def test_a_timeline_has_a_row_for_each_layer_and_the_durations_of_transitions() -> None:
    assert layers_of("squat | punch on arms") == ["squat", "punch on arms"]
    assert layers_of("(squat | punch on arms) [0.7:6.6]") == ["squat", "punch on arms"]
    assert layers_of("squat [1:2] mirrored") == ["squat [1:2] mirrored"]
    assert layers_of("any: thing") == ["any: thing"]
    part = {"enter": 0.0, "leave": 1.0, "wanted": True, "coefficient": None}
    physics = {"zmp_inside": 0.05, "torque": 0.7, "bent": True, "through_standing": False}
    record = {"duration": 5.0, "parts": [
        {**part, "what": "squat | punch on arms", "begins": 0.0, "ends": 2.0},
        {**part, "what": "physical", "begins": 2.0, "ends": 2.6, "coefficient": 1.0,
         "physics": physics},
        {**part, "what": "stand", "begins": 2.6, "ends": 5.0},
    ]}  # fmt: skip
    out = timeline_picture(record).out
    boxes = [np.ptp(points(mark)[:, 0]) for text, mark in marks(out, "").items()
             if not text.startswith("physical")]  # fmt: skip
    assert boxes == pytest.approx([boxes[0] * s / 2.0 for s in (2.0, 2.0, 2.4)], abs=0.3)
    assert "physical, 0.60 s, ZMP 5.0 cm inside, torque 70%, bent" in marks(out, "")
    words = [e.text for e in drawing(out.svg).iter("text")]
    assert {"base", "over 1", "squat", "punch on arms", "stand", "0.6"} <= set(words)
    for wrong in ({}, {"parts": [{}]}, {"parts": "x", "duration": 1.0}, []):
        with invalid("parts"):
            timeline_picture(wrong)


def test_a_performance_is_seen_with_its_push(tmp_path: Path) -> None:
    """The push moves β and the errors; the measured CoP is where the motion's ZMP is before it."""
    robot, watched = robot_named("humanoid"), Watched()
    motion = load_motion("bow", robot)
    (trial,) = follow(motion, robot=robot, starts=1, impulse=12.0, watch=watched)
    trace = watched.tracers[0].trace()
    ((start, length),) = trace.pushes
    before = (trace.time > start - 0.3) & (trace.time < start)
    after = (trace.time > start + length) & (trace.time < start + 0.5)
    assert trace.bodies[after].max() > 2.0 * trace.bodies[before].max()
    assert trace.beta[after].min() < 0.9 < trace.beta[before].min()
    assert np.allclose(trace.tempo, 1.0) and not trace.fallen and not trial.fallen
    counted = (trace.time > 0.01) & (trace.time < motion.duration + 0.5)
    assert trace.bodies[counted].mean() == pytest.approx(trial.body_error, rel=0.02)
    judged = check_motion(motion, robot)
    middle = judged.support.mean(axis=0)
    zmp = np.interp(trace.time[before], judged.times, judged.zmp[:, 0] - middle[0])
    assert np.abs(trace.cop[before, 0] - zmp).mean() < 0.02
    path = tmp_path / "page.html"
    pictures = [errors_picture(trace), zmp_picture(judged, trace)]
    write_page(path, "a <title>", "lead", pictures)
    text = path.read_text()
    assert (
        "a &lt;title&gt;" in text
        and text.count('class="plot"') == 2
        and "prefers-color-scheme" in text
    )
    assert not re.search(r"(src|href)=", text)


def test_the_soles_of_steps_are_those_that_are_planted() -> None:
    """Both, one, both, the other one, both: to the side five boxes. Ahead one sole beside the other
    reaches as far as both, so there are three, the last one further up than the first."""
    robot = robot_named("humanoid")
    judged = check_motion(ahead_clip(robot), robot)
    out = zmp_picture(judged).out
    boxes = [points(group[-1]) for group in groups(out, "") if group[0].text == "soles"]
    assert len(boxes) == 8
    (first, apart, last) = ((box[:, 1].min(), np.ptp(box[:, 1])) for box in boxes[:3])
    assert last[0] < first[0] - 10.0 and last[1] == pytest.approx(first[1], abs=1.0)
    assert apart[0] == pytest.approx(last[0], abs=1.0) and apart[1] > first[1] + 10.0
    sides = [np.ptp(box[:, 1]) for box in boxes[3:]]
    assert max(sides[1], sides[3]) < 0.6 * min(sides[0], sides[2], sides[4])


def test_the_page_is_html() -> None:
    with invalid(None, source="x.png"):
        check_page(Path("x.png"))
