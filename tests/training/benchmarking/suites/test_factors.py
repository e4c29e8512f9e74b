"""The suites of benchmarks: training/benchmarking/suites/factors.py, directions.py and plan.py."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite, load_suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.table import trial_row
from poise.training.benchmarking.trials.trial import Outcome, Trial, failed_trial
from tests.support.benchmarks_small import SMALL, TRIALS
from tests.support.shared import robot


def small(seed: int = 0, names: tuple[str, ...] = ("a",), **changes: object) -> TrialPlan:
    suite = build(Suite, {**SMALL, **changes}, "small")
    return TrialPlan(suite, PushLimits(robot()), seed, names)


def part(plan: TrialPlan, name: str) -> list[Trial]:
    return [trial for trial in plan.first if trial.part == name]


def won_below(plan: TrialPlan, edge: float) -> dict[tuple[str, int], Outcome]:
    """The first stage, as if pushes below an impulse had been recovered."""
    return {
        (name, trial.number): Outcome(trial.push is None or trial.push.impulse < edge, False)
        for name in plan.names for trial in plan.first
    }  # fmt: skip


@pytest.mark.parametrize("name", ["quick", "standard", "full"])
def test_the_packaged_suites_of_benchmarks(name: str) -> None:
    """Every trial has a number of its own; the standard suite asks all that a ranking needs."""
    plan = TrialPlan(load_suite(name), PushLimits(robot()), 0, ["a"])
    numbers = [trial.number for trial in plan.trials(won_below(plan, 1e9))["a"]]
    assert numbers == list(range(plan.count))
    if name == "standard":
        envelope = plan.suite.envelope
        assert envelope is not None and envelope.directions == 16
        assert envelope.first_trials + envelope.trials >= 20
        assert {trial.factor for trial in part(plan, "factors")} == {
            "standard", "duration", "body", "height", "friction", "delay", "mass_error", "pushes",
            "realism",
        }  # fmt: skip


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("envelop: {}", "envelop: unknown field"),
        ("envelope: {directions: 0}", "envelope.directions: must be at least 1"),
        ("factors: {levels: {delay: [1.0]}}", r"factors.levels.delay\[0\]: must be at most 0.1"),
        ("mix: {fractions: [1.0, 0.5]}", "mix: fractions: the range .* must not decrease"),
        ("mix: {delay: []}", "mix: delay: must not be empty"),
    ],
)
def test_a_suite_that_is_not_valid_is_refused(tmp_path: Path, text: str, message: str) -> None:
    """The text names the file and the field."""
    path = tmp_path / "suite.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=f"suite.yaml: {message}"):
        load_suite(path)


def test_trials_depend_on_suite_and_seed_alone() -> None:
    """Equal for an equal seed, all different for another; not on who takes part."""
    one, again, other = small(), small(names=("b", "c")), small(1)
    assert one.first == again.first
    pushes = [{trial.push for trial in part(plan, "envelope")} for plan in (one, other)]
    assert not pushes[0] & pushes[1]
    assert again.count == 2 * TRIALS


def test_the_second_stage_lies_around_the_rough_j50() -> None:
    """Within ±30 % of the impulse at which the first stage was lost; numbers follow the first."""
    plan = small(envelope={"directions": 2, "fractions": [0.2, 2.0], "first_trials": 8,
                           "trials": 4})  # fmt: skip
    second = plan.second(won_below(plan, 20.0))["a"]
    impulses = np.array([trial.push.impulse for trial in second])
    assert len(second) == 8 and [trial.number for trial in second] == list(range(16, 24))
    assert impulses.min() > 0.7 * 15 and impulses.max() < 1.3 * 27
    assert np.ptp(impulses[:4]) > 5.0 and all(trial.stage == 2 for trial in second)
    lost = plan.second(won_below(plan, 0.0))["a"]
    assert max(trial.push.impulse for trial in lost) < impulses.max()


def test_levels_meet_the_same_starts_directions_and_fractions() -> None:
    """Within a factor only the factor differs; the standard case is first."""
    cases = small(factors={
        "trials": 3,
        "levels": {"duration": [0.3], "body": True, "height": [1.0], "friction": [0.4, 0.8],
                   "delay": [0.02], "mass_error": [0.1], "pushes": [3]},
    })  # fmt: skip
    rows = part(cases, "factors")
    standard, rest = rows[:3], rows[3:]
    assert {case.factor for case in standard} == {"standard"}
    assert "0.8" not in {case.level for case in rest}  # the robot's own friction is the standard
    cells = [rest[k : k + 3] for k in range(0, len(rest), 3)]
    for cell in cells:
        assert len({(case.factor, case.level) for case in cell}) == 1
        for case, base in zip(cell, standard, strict=True):
            assert case.seed == base.seed and case.push.direction == base.push.direction
            assert case.limit_fraction == pytest.approx(base.limit_fraction)
    changed = {cell[0].factor: cell[0] for cell in cells}
    assert changed["duration"].push.duration == 0.3
    assert changed["duration"].push.impulse > standard[0].push.impulse
    assert (
        changed["friction"].conditions.friction == 0.4 and changed["delay"].conditions.delay == 0.02
    )
    assert changed["mass_error"].conditions.mass_error == 0.1 and len(changed["pushes"].pushes) == 3
    bodies = {cell[0].push.body for cell in cells if cell[0].factor == "body"}
    assert bodies == set(robot().description.push_bodies[1:])


def test_the_standard_friction_is_that_of_the_contacts() -> None:
    """Soles of a priority of their own decide it: `compact` stands on 0.8, though its ground has
    1.0, and the suite's level 1.0 is another cell."""
    cases = TrialPlan(load_suite("standard"), PushLimits(robot("compact")), 0, ["a"])
    assert cases.standard["friction"] == "0.8"
    levels = {case.conditions.friction for case in cases.first if case.factor == "friction"}
    assert levels == {0.4, 0.6, 1.0}


def test_a_height_is_a_point_of_the_first_push_body() -> None:
    """At 1.0 the point lies at the height of the robot's CoM."""
    cases = small(factors={"trials": 1, "levels": {"height": [1.0]}})
    push = next(case.push for case in cases.first if case.factor == "height")
    centre = float(cases.standard["height"]) * robot().height_com
    assert push.body == robot().description.push_bodies[0]
    assert push.point[2] == pytest.approx(robot().height_com - centre, abs=0.01)
    assert push.point[:2] == pytest.approx((0.0, 0.0), abs=0.02)


def test_the_mix_stays_in_its_ranges_and_uses_all_of_them() -> None:
    """Every factor varies; fractions and directions are spread evenly."""
    mix = {"trials": 60, "delay": [0.0, 0.02], "friction": [0.5, 0.6], "repeated": 0.5}
    cases = part(small(mix=mix), "mix")
    assert all(
        0.5 <= c.conditions.friction <= 0.6 and -0.1 <= c.conditions.mass_error <= 0.1
        for c in cases
    )
    assert {c.conditions.delay for c in cases} == {0.0, 0.02} and {
        len(c.pushes) for c in cases
    } == {
        1,
        2,
    }
    assert all(0.05 <= case.push.duration <= 0.5 for case in cases)
    assert {case.push.body for case in cases} == set(robot().description.push_bodies)
    sectors = np.histogram([case.push.direction for case in cases], bins=6, range=(0, 360))[0]
    assert set(sectors) == {10}
    shares = np.histogram([case.limit_fraction for case in cases], bins=4, range=(0.3, 1.1))[0]
    assert set(shares) == {15}


def test_margins_repeat_one_push_from_different_starts() -> None:
    """Levels are fractions of the ankle limit in the direction."""
    suite = {"directions": [0, 90], "levels": [0.5, 1.0], "runs": 3}
    cases = part(small(margin=suite), "margin")
    assert len({case.seed for case in cases}) == len(cases) == 12
    limit = PushLimits(robot()).ankle(90, 0.1)
    assert [case.push.impulse for case in cases[6:9]] == pytest.approx([0.5 * limit] * 3)


def test_a_repeated_push_comes_again_after_the_interval() -> None:
    """The options of the reset hold all pushes, alike but for their start."""
    case = next(trial for trial in small().first if trial.factor == "pushes")
    pushes = case.options["push"]
    assert [push.start for push in pushes] == pytest.approx([0.1, 0.4])
    assert pushes[0] == case.push and replace(pushes[1], start=0.1) == case.push
    assert Trial(0, 1).options == {"push": []}


def test_resized_suites_have_small_cells() -> None:
    """No cell has more; the envelope's first stage keeps two, for a fit."""
    suite = load_suite("full").resized(1)
    assert (suite.envelope.first_trials, suite.envelope.trials) == (2, 1)
    assert suite.margin.runs == suite.factors.trials == suite.mix.trials == 1
    assert load_suite("quick").resized(10**6) == load_suite("quick")


def test_an_error_is_a_row_like_others() -> None:
    """Not recovered, no figures, and what was raised on one line."""
    case = small().first[0]
    row = trial_row(case, "mine", failed_trial(RuntimeError("a\nb")))
    assert row["error"] == "RuntimeError: a b" and row["recovered"] is False
    assert row["energy"] is None and row["impulse"] == case.push.impulse
