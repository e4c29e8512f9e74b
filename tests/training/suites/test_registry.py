"""training/suites/base.py, training/suites/registry.py and training/suites/directions.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.configs.files import packaged
from poise.configs.schema import to_dict
from poise.envs.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.training.suites.registry import EnvelopeSuite, GridSuite, build_suite, load_suite
from poise.training.trials.push_limits import PushLimits
from tests.support.evaluations import write_suite


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot(), LimitTable((0.0,), (16.0,)))


@pytest.mark.parametrize("name", packaged("suites"))
def test_every_packaged_suite_gives_as_many_trials_as_it_says(
    name: str, limits: PushLimits
) -> None:
    """Numbers run from 0, start seeds differ, the same seed gives the same trials."""
    suite = load_suite(name).resized(3)
    trials = suite.first(limits, 7)
    if isinstance(suite, EnvelopeSuite):
        won = {name: [False] * len(trials) for name in "ab"}
        trials = trials + suite.more(limits, 7, trials, won)
    assert len(trials) == suite.count(2)
    assert [trial.number for trial in trials] == list(range(len(trials)))
    assert len({trial.seed for trial in trials}) == len(trials)
    assert suite.first(limits, 7) == trials[: len(suite.first(limits, 7))]
    other = suite.first(limits, 8)
    assert not {trial.seed for trial in other} & {trial.seed for trial in trials}
    if name not in ("grid", "quiet", "repeated"):
        assert not {trial.push.impulse for trial in other} & {t.push.impulse for t in trials}
    assert build_suite(to_dict(suite), "again") == suite


def test_random_pushes_are_as_described(limits: PushLimits) -> None:
    """Between 0.5 and 1.6 of the limit, on all of the robot's bodies, in all directions."""
    trials = load_suite("random").resized(400).first(limits, 0)
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
    assert suite.resized(9).first(limits, 1)[:4] == suite.resized(4).first(limits, 1)


def test_without_a_table_pushes_are_fractions_of_the_ankle_limit() -> None:
    """A robot whose baseline was not measured meets the same fractions of its ankle limit."""
    trials = load_suite("random").resized(50).first(PushLimits(load_robot()), 0)
    fractions = [trial.limit_fraction or 0.0 for trial in trials]
    assert 0.5 <= min(fractions) and max(fractions) <= 1.6


def test_the_second_stage_surrounds_each_rough_j50(limits: PushLimits) -> None:
    """Trials spread over J50 · (1 ± spread) of every controller, in every direction, stratified."""
    suite = EnvelopeSuite(directions=2, first_trials=20, trials=10, spread=0.2)
    first = suite.first(limits, 0)
    impulse = np.array([trial.push.impulse for trial in first])
    won = {"weak": (impulse < 12.0).tolist(), "strong": (impulse < 20.0).tolist()}
    second = suite.more(limits, 0, first, won)
    assert {trial.stage for trial in second} == {2} and second[0].number == len(first)
    for angle in (0.0, 180.0):
        found = np.sort([t.push.impulse for t in second if t.push.direction == angle])
        weak, strong = found[:10], found[10:]
        assert weak.min() == pytest.approx(0.8 * 12.0, rel=0.12)
        assert weak.max() == pytest.approx(1.2 * 12.0, rel=0.12)
        assert strong.mean() == pytest.approx(20.0, rel=0.06)
        assert np.diff(weak).max() < 2 * 0.4 * 13.0 / 10
    assert suite.more(limits, 0, first + second, won) == []


def test_the_grid_has_every_magnitude_in_every_direction(limits: PushLimits) -> None:
    """Repeats differ in their start alone; units are those of pushes."""
    suite = GridSuite(directions=4, magnitudes=(0.5, 1.0), unit="ankle_fraction", repeats=3)
    trials = suite.first(limits, 0)
    pushes = {(t.push.direction, t.push.impulse) for t in trials}
    assert len(trials) == 24 and len(pushes) == 8
    left = sorted(impulse for direction, impulse in pushes if direction == 90.0)
    assert left == pytest.approx([0.5 * limits.ankle(90.0, 0.1), limits.ankle(90.0, 0.1)])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"kind": "randm"}, "kind.*choices: random, envelope, grid, quiet, sequence"),
        ({"kind": "random", "trials": 0}, "trials.*at least 1"),
        ({"kind": "random", "pushes": {"magnitude": [1, 2], "unit": "delta_v"}}, "pushes"),
        ({"kind": "random", "pushes": {"magnitude": [2, 1], "unit": "impulse"}}, "magnitude"),
        ({"kind": "envelope", "impulses": [0.5, 0.2]}, "impulses"),
        ({"kind": "grid", "magnitudes": []}, "magnitudes"),
        ({"kind": "quiet", "pushes": None}, "pushes.*choices: kind, duration"),
        ({"kind": "quiet", "duration": "long"}, "duration.*a number"),
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
        EnvelopeSuite(body="tail").first(limits, 0)
