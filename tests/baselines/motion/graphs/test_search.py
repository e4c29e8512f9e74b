"""Paths through motion graphs: equal to walking every path, and what is said if there is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.motion.graphs.layers import SHORT
from poise.baselines.motion.graphs.motion_graph import (
    GraphClip,
    MotionGraph,
    Thresholds,
    Transition,
)
from poise.baselines.motion.graphs.paths import PathTask
from poise.baselines.motion.graphs.search import best_paths
from poise.configs.errors import ConfigError
from tests.support.motion_graphs import check_search
from tests.support.refused import invalid, refused

GRAPHS = 40  # python -m tests.performance.motion_search walks 1,000


def test_the_cheapest_paths_are_those_of_walking_them_all() -> None:
    found = [check_search(seed) for seed in range(GRAPHS)]
    assert sum(count == 3 for count in found) > GRAPHS // 4  # not all without a path
    assert 0 in found


def chain(*pairs: tuple[str, str], **settings) -> MotionGraph:
    """Clips of 2 s, each pair joined from end to begin in 1 s at K = 2."""
    names = sorted({name for pair in pairs for name in pair})
    clips = tuple(GraphClip(name, f"{name}.bvh", 2.0) for name in names)
    joins = tuple(Transition(a, b, 2.0, 0.0, 1.0, 2.0) for a, b in pairs)
    return MotionGraph("", Thresholds(time_price=1.0), clips, transitions=joins, **settings)


def clips_of(graph: MotionGraph, task: PathTask) -> list[str]:
    return [step.clip for step in best_paths(graph, task)[0].steps]


def test_what_was_left_out_is_found() -> None:
    """The dissertation's example: lie → stand up becomes squat → lie → squat → stand up."""
    graph = chain(("squat", "lie"), ("lie", "squat"), ("squat", "stand"))
    (path,) = best_paths(graph, PathTask(("lie", "stand")))
    assert [step.clip for step in path.steps] == ["lie", "squat", "stand"]
    assert [step.wanted for step in path.steps] == [True, False, True]
    assert path.steps[0].after == graph.transitions[1] and path.steps[2].after is None
    assert path.cost == pytest.approx(2 * 3.0 + 2.0, abs=10 * SHORT)


def test_start_and_goal_are_places_in_clips() -> None:
    graph = chain(("squat", "lie"), ("lie", "squat"), ("squat", "stand"))
    task = PathTask(("lie",), start={("squat", 1.0): 0.5}, goal={("stand", 1.5): 0.25})
    (path,) = best_paths(graph, task)
    steps = [(step.clip, step.enter, step.leave) for step in path.steps]
    assert steps == [("squat", 1.0, 2.0), ("lie", 0.0, 2.0), ("squat", 0.0, 2.0),
                     ("stand", 0.0, 1.5)]  # fmt: skip
    assert path.cost == pytest.approx(0.5 + 1.0 + 3 * 3.0 + 2.0 + 1.5 + 0.25, abs=10 * SHORT)


def test_a_wanted_clip_is_played_in_its_main_part() -> None:
    """A cheap way that leaves it in the middle is no way; one in its last quarter is."""
    graph = chain(("a", "b"))
    early = Transition("a", "b", 1.4, 0.0, 1.0, 0.0)
    late = Transition("a", "b", 1.6, 0.4, 1.0, 0.0)
    with_early = replace(graph, transitions=(*graph.transitions, early))
    assert best_paths(with_early, PathTask(("a", "b")))[0].steps[0].leave == 2.0
    with_late = replace(graph, transitions=(*graph.transitions, early, late))
    (path,) = best_paths(with_late, PathTask(("a", "b")))
    assert path.steps[0].after == late
    assert path.cost == pytest.approx(1.0 + 0.4 + 0.4, abs=10 * SHORT)


def test_jumping_ahead_and_playing_on_are_two_ways() -> None:
    """Between the same moments the cheaper one counts, on the way as between wanted clips."""
    graph = chain(("a", "b"), ("b", "c"))
    for cost, skips in ((0.1, True), (5.0, False)):
        jump = Transition("b", "b", 0.25, 1.75, 0.05, cost)
        whole = replace(graph, transitions=(*graph.transitions, jump))
        (path,) = best_paths(whole, PathTask(("a", "c")))
        assert (jump in [step.after for step in path.steps]) == skips
        assert path.cost == pytest.approx(6.0 + (0.5 + 0.15 if skips else 2.0), abs=10 * SHORT)


def test_the_best_k_begin_with_the_best() -> None:
    graph = chain(("a", "b"), ("a", "c"), ("c", "b"), ("a", "d"), ("d", "c"))
    paths = best_paths(graph, PathTask(("a", "b")), 5)
    assert [[step.clip for step in path.steps] for path in paths] == [
        ["a", "b"], ["a", "c", "b"], ["a", "d", "c", "b"]]  # fmt: skip
    best = best_paths(graph, PathTask(("a", "b")))[0]  # whose cost is summed from the other end
    assert paths[0].steps == best.steps and paths[0].cost == pytest.approx(best.cost, rel=1e-14)


def test_an_arrow_by_hand_is_taken_though_the_graph_has_none() -> None:
    graph = chain(("a", "b"), ("b", "c"))
    arrow = Transition("a", "c", 2.0, 0.0, 0.4, 50.0)
    (path,) = best_paths(graph, PathTask(("a", "c"), {0: arrow}))
    assert [step.clip for step in path.steps] == ["a", "c"] and path.steps[0].after == arrow


def test_what_cannot_be_made_is_gone_round_and_asked_about_once() -> None:
    graph, asked = chain(("a", "b"), ("a", "c"), ("c", "b"), ("a", "d"), ("d", "b")), []
    dear = replace(graph.transitions[3], coefficient=4.0)
    graph = replace(graph, transitions=(*graph.transitions[:3], dear, graph.transitions[4]))

    def check(transition: Transition) -> str:
        asked.append(transition)
        return "too fast" if transition.after == "b" and transition.before != "d" else ""

    (path,) = best_paths(graph, PathTask(("a", "b")), check=check)
    assert [step.clip for step in path.steps] == ["a", "d", "b"]
    assert len(asked) == len(set(asked)) == 5
    with invalid(None, "'a'", "'b'"):
        best_paths(graph, PathTask(("a", "b")), check=lambda t: "never" if t.after == "b" else "")


def test_no_way_says_how_far_it_goes_and_what_is_nearest() -> None:
    refused = (("a", "jump", "K = 90 > 20"), ("b", "jump", "K = 41 > 20"),
               ("x", "jump", "K = 1 > 0.5"), ("a", "jump", "other feet are planted"))  # fmt: skip
    graph = replace(chain(("a", "b"), ("jump", "x")), refused=refused)
    with pytest.raises(ConfigError) as caught:
        best_paths(graph, PathTask(("a", "jump", "a")))
    assert str(caught.value) == (
        "no way from 'a' to 'jump' (reachable: a, b; nearest to it: K = 41 > 20)"
    )
    with invalid(None, "'a'"):
        best_paths(graph, PathTask(("a",), start={("b", 1.0): 0.0}))
    with invalid(None, "'a'"):
        best_paths(graph, PathTask(("a",), goal={("x", 1.0): 0.0}))


def test_wrong_tasks() -> None:
    graph = chain(("a", "b"))
    with invalid("actions", "'wawe'", "a", "b"):
        best_paths(graph, PathTask(("a", "wawe")))
    with refused("range", "k", least=1, value="0"):
        best_paths(graph, PathTask(("a",)), 0)
    with invalid("actions"):
        best_paths(graph, PathTask(()))
    assert np.isfinite(best_paths(graph, PathTask(("b",)))[0].cost)
