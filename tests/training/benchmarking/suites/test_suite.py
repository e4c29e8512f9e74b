"""training/benchmarking/suites/suite.py, plan.py, directions.py and random.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.configs.schema import build, to_dict
from poise.envs.physics.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.suites.directions import Envelope, Grid
from poise.training.benchmarking.suites.factors import Factors, Levels
from poise.training.benchmarking.suites.plan import LEVEL, TrialPlan
from poise.training.benchmarking.suites.random import Quiet
from poise.training.benchmarking.suites.suite import Suite, load_suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial
from tests.support.evaluations import write_suite


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot(), LimitTable((0.0,), (16.0,)))


def first(suite: Suite, limits: PushLimits, seed: int) -> list[Trial]:
    return TrialPlan(suite, limits, seed, ["a"]).first


def finished(plan: TrialPlan, won: Callable[[str, Trial], bool]) -> dict[tuple[str, int], Outcome]:
    """The first stage, as if it had been played."""
    return {(name, trial.number): Outcome(recovered=won(name, trial), fallen=False)
            for name in plan.names for trial in plan.first}  # fmt: skip


@pytest.mark.parametrize("name", packaged("suites"))
def test_every_packaged_suite_gives_as_many_trials_as_it_says(
    name: str, limits: PushLimits
) -> None:
    """Numbers run from 0, start seeds differ, the same seed gives the same trials."""
    suite = load_suite(name).resized(3)
    motions = dict.fromkeys(suite.motions.labels, 5.0) if suite.motions else {}
    plan = TrialPlan(suite, limits, 7, ["a", "b"], motions)
    found = plan.trials(finished(plan, lambda name, trial: False))
    assert sum(len(trials) for trials in found.values()) == plan.count
    for trials in found.values():
        assert [trial.number for trial in trials] == list(range(len(trials)))
        once = [trial for trial in trials if LEVEL not in trial.part]
        assert {trial.part for trial in once} - {"standing"} == set(suite.parts)
        alike = ("factors", "motions", "scenarios")  # whose cells start alike
        own = [trial.seed for trial in once if trial.part not in alike]
        assert len(set(own)) == len(own)
    assert first(suite, limits, 7) == TrialPlan(suite, limits, 7, ["a"]).first
    other = first(suite, limits, 8)
    assert not {trial.seed for trial in other} & {trial.seed for trial in plan.first}
    if name not in ("grid", "wide-grid", "quiet", "repeated") and not (
        suite.walks and name != "walk-push"
    ):
        parts = ("margin",)  # whose pushes are the same for any seed
        pushes = [{trial.push.impulse for trial in trials if trial.push and trial.part not in parts}
                  for trials in (other, plan.first)]  # fmt: skip
        assert not pushes[0] & pushes[1]
    assert build(Suite, to_dict(suite), "again") == suite


def test_random_pushes_are_as_described(limits: PushLimits) -> None:
    """Between 0.5 and 1.6 of the limit, on all of the robot's bodies, in all directions."""
    trials = first(load_suite("random").resized(400), limits, 0)
    fractions = np.array([trial.limit_fraction for trial in trials])
    assert 0.5 <= fractions.min() < 0.55 and 1.55 < fractions.max() <= 1.6
    assert {trial.push.body for trial in trials} == set(limits.robot.description.push_bodies)
    directions = np.array([trial.push.direction for trial in trials])
    assert np.histogram(directions, 4, (0, 360))[0].min() > 70
    durations = [trial.push.duration for trial in trials]
    assert 0.05 <= min(durations) and max(durations) <= 0.3


def test_more_random_trials_leave_the_first_as_they_were(limits: PushLimits) -> None:
    """--trials 1000 starts with the trials of --trials 500."""
    suite = load_suite("random")
    more, fewer = (first(suite.resized(count), limits, 1) for count in (9, 4))
    assert len(more) == 9 and more[:4] == fewer


def test_without_a_table_pushes_are_fractions_of_the_ankle_limit() -> None:
    """A robot whose baseline was not measured meets the same fractions of its ankle limit."""
    trials = first(load_suite("random").resized(50), PushLimits(load_robot()), 0)
    fractions = [trial.limit_fraction or 0.0 for trial in trials]
    assert 0.5 <= min(fractions) and max(fractions) <= 1.6


def test_the_second_stage_surrounds_each_rough_j50(limits: PushLimits) -> None:
    """Trials spread over J50 · (1 ± spread) of every controller, in every direction, stratified;
    paired, all controllers meet all of them."""
    part = Envelope(directions=2, first_trials=20, trials=10, spread=0.2, impulses=(0.12, 0.9),
                    paired=True)  # fmt: skip
    suite, edge = Suite(envelope=part), {"weak": 12.0, "strong": 20.0}
    plan = TrialPlan(suite, limits, 0, tuple(edge))
    played = finished(plan, lambda name, trial: trial.push.impulse < edge[name])
    second = plan.second(played)["weak"]
    assert second == plan.second(played)["strong"]
    assert {trial.stage for trial in second} == {2} and second[0].number == len(plan.first)
    for angle in (0.0, 180.0):
        found = np.sort([t.push.impulse for t in second if t.push.direction == angle])
        weak, strong = found[:10], found[10:]
        assert weak.min() == pytest.approx(0.8 * 12.0, rel=0.12)
        assert weak.max() == pytest.approx(1.2 * 12.0, rel=0.12)
        assert strong.mean() == pytest.approx(20.0, rel=0.06)
        assert np.diff(weak).max() < 2 * 0.4 * 13.0 / 10
    alone = TrialPlan(Suite(envelope=replace(part, paired=False)), limits, 0, tuple(edge))
    assert alone.first == plan.first and alone.count == plan.count - 2 * 2 * 10
    own = alone.second(played)
    assert own["weak"][0].push.impulse == second[0].push.impulse
    assert np.mean([t.push.impulse for t in own["strong"]]) == pytest.approx(20.0, rel=0.06)


def test_the_grid_has_every_magnitude_in_every_direction(limits: PushLimits) -> None:
    """Repeats differ in their start alone; units are those of pushes."""
    grid = Grid(directions=4, magnitudes=(0.5, 1.0), unit="ankle_fraction", repeats=3)
    trials = first(Suite(grid=grid), limits, 0)
    pushes = {(t.push.direction, t.push.impulse) for t in trials}
    assert len(trials) == 24 and len(pushes) == 8
    left = sorted(impulse for direction, impulse in pushes if direction == 90.0)
    assert left == pytest.approx([0.5 * limits.ankle(90.0, 0.1), limits.ankle(90.0, 0.1)])


def test_parts_are_played_one_after_the_other(limits: PushLimits) -> None:
    """A part's trials are those that it has behind others of as many; names say which is which."""
    suite = load_suite("random").resized(3)
    both = replace(suite, quiet=Quiet(trials=2))
    trials = first(both, limits, 1)
    assert trials[:3] == first(suite, limits, 1)
    assert [trial.part for trial in trials] == ["random"] * 3 + ["quiet"] * 2
    assert both.resized(1).parts == {"random": suite.resized(1).random, "quiet": Quiet(1)}
    assert suite.resized(10**4).random.trials == 10**4 and both.resized(10**4) == both


#: pushes that may begin after the trial
LATE = {"magnitude": [1, 2], "unit": "impulse", "start": [0.5, 100]}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"randm": {}}, "randm: unknown field.*choices: .*random, sequence, quiet"),
        (
            {"kind": "random", "trials": 3},
            "kind: unknown field.*choices: .*random",
        ),
        ({"duration": 3.0}, "needs one part or more: envelope, grid"),
        ({"random": {"trials": 0}}, "random.trials.*at least 1"),
        ({"random": {"pushes": {"magnitude": [1, 2], "unit": "delta_v"}}}, "pushes"),
        ({"random": {"pushes": {"magnitude": [2, 1], "unit": "impulse"}}}, "magnitude"),
        ({"envelope": {"impulses": [0.5, 0.2]}}, "impulses"),
        ({"grid": {"magnitudes": []}}, "magnitudes"),
        ({"quiet": {"pushes": None}}, "pushes.*choices: trials"),
        ({"start": 3.0, "grid": {}, "duration": 3.0}, ": start: must lie within the duration, 3 s"),
        *(
            ({name: {"pushes": {**LATE, **more}}}, rf": {name}.pushes.start: must lie within")
            for name, more in (
                ("random", {}),
                ("sustained", {}),
                ("sequence", {"count": [2, 2]}),
                ("gusts", {"count": [2, 2]}),
                ("walk_repeated", {"count": [2, 2]}),
            )
        ),
        ({"walk_push": {"start": 6.0}}, ": walk_push.start: must lie within the duration, 6 s"),
        (
            {"scenarios": {"each": {"crowd": {"pushes": LATE, "duration": 5.0}}}, "duration": 9.0},
            ": scenarios.each.crowd.pushes.start: must lie within the duration, 5 s",
        ),
        ({"duration": "long", "quiet": {}}, "duration.*a number"),
    ],
)
def test_a_wrong_suite_is_refused(tmp_path: Path, fields: dict[str, Any], message: str) -> None:
    """The text names the file, the field and the choices."""
    path = write_suite(tmp_path, fields)
    with pytest.raises(ConfigError, match=message) as error:
        load_suite(path)
    assert str(path) in str(error.value)


def test_an_unknown_suite_or_body_is_refused(limits: PushLimits) -> None:
    """The packaged suites are listed, and the robot's bodies."""
    with pytest.raises(ConfigError, match="envelope.*grid.*quiet.*random"):
        load_suite("rndom")
    with pytest.raises(ConfigError, match="tail.*torso"):
        TrialPlan(Suite(body="tail", quiet=Quiet()), limits, 0, ["a"])


def test_levels_meet_the_same_starts_and_pushes(limits: PushLimits) -> None:
    """Each level has the trials of the suite's own, numbered on; factors are played once."""
    own = Suite(
        envelope=Envelope(directions=2, first_trials=3, trials=2),
        factors=Factors(trials=2, levels=Levels(delay=(0.01,))),
        quiet=Quiet(2),
    )
    plan = TrialPlan(replace(own, levels=("lab", "field")), limits, 7, ["a"])
    alone = TrialPlan(own, limits, 7, ["a"])
    # at `lab` nothing is recovered, elsewhere all is
    lost = {trial.number for trial in plan.first if trial.part.endswith("@lab")}
    found = plan.trials(finished(plan, lambda name, trial: trial.number not in lost))["a"]
    known = alone.trials(finished(alone, lambda name, trial: True))["a"]
    assert found[: len(known)] == known
    assert [trial.number for trial in found] == list(range(plan.count))
    repeated = [trial for trial in known if trial.part != "factors"]
    for level in ("lab", "field"):
        there = [trial for trial in found if trial.conditions.realism == level]
        assert [t.part for t in there] == [f"{t.part}@{level}" for t in repeated]
        assert [t.seed for t in there] == [t.seed for t in repeated]
        same = [a.pushes == b.pushes for a, b in zip(there, repeated, strict=True)]
        second = [t.stage == 2 for t in repeated]
        assert all(s or t for s, t in zip(same, second, strict=True))
        assert all(same) == (level == "field")  # the second stage is around the J50 there


@pytest.mark.parametrize("levels", [["field", "field"], ["ideal"], ["a/field.yaml", "field"]])
def test_a_level_comes_once(tmp_path: Path, levels: list[str]) -> None:
    with pytest.raises(ConfigError, match="comes twice"):
        load_suite(write_suite(tmp_path, {"quiet": {"trials": 2}, "levels": levels}))
