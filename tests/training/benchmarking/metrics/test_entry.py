"""training/benchmarking/metrics/entry.py and training/benchmarking/metrics/pairs.py."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.config import StepLimits
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.metrics.entry import controller_entry
from poise.training.benchmarking.metrics.pairs import pair_figures
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.random import Quiet
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import NStepLimit
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.columns import J50_KEPT, J50_MEAN
from poise.training.running.files import plain
from poise.training.running.summary import Entry, Pair
from tests.training.benchmarking.evaluation.test_folder import OUTCOME


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot())


def outcomes(won: list[bool]) -> list[Outcome]:
    fallen = replace(OUTCOME, recovered=False, fallen=True, solver_failures=1, foot_displaced=True)
    return [replace(OUTCOME, solver_failures=0) if w else fallen for w in won]


def trials(
    limits: PushLimits, impulses: list[float], angles: list[float], part: str = "envelope"
) -> list[Trial]:
    pushes = [Push("torso", 0.5, 0.1, j, a) for j, a in zip(impulses, angles, strict=True)]
    return [
        Trial(i, i, (p,), limit_fraction=limits.fraction(p), part=part)
        for i, p in enumerate(pushes)
    ]


def summarise(
    trials: list[Trial],
    results: dict[str, list[Outcome]],
    limits: PushLimits,
    steps: dict[str, NStepLimit] | None = None,
) -> tuple[dict[str, Entry], list[Pair]]:
    """Entries of the controllers, and the pair of the first two."""
    plan = TrialPlan(Suite(quiet=Quiet()), limits, 0, tuple(results))
    played = {name: list(zip(trials, own, strict=True)) for name, own in results.items()}
    entries = {name: controller_entry(own, plan, (steps or {}).get(name))
               for name, own in played.items()}  # fmt: skip
    names = list(played)
    return entries, [pair_figures(*names[:2], played, entries)] if len(names) > 1 else []


def test_counts_and_pairs(limits: PushLimits) -> None:
    """Recovered, lost and won trials are counted, each pair once, b against a."""
    some = trials(limits, [5.0, 10.0, 15.0, 20.0], [0.0, 100.0, 200.0, 300.0], "random")
    entries, (pair,) = summarise(
        some,
        {"a": outcomes([True, False, False, True]), "b": outcomes([True, True, True, False])},
        limits,
    )
    a = entries["a"]
    assert (a["trials"], a["recovered"], a["recovered_rate"]) == (4, 2, 0.5)
    assert a["fallen"] == 2 and a["solver_failures"] == 2 and a["recovered_with_step"] == 0
    assert 0.1 < a["recovered_ci95"][0] < 0.5 < a["recovered_ci95"][1]
    assert (pair["both"], pair["only_a"], pair["only_b"], pair["neither"]) == (1, 1, 2, 0)
    assert pair["p_mcnemar"] == 1.0 and pair["rate_gain"] == 0.25 and not pair["identical"]
    assert a["fraction_of"] == "ankle limit"
    assert [s["direction"] for s in a["sectors"]] == [0.0, 90.0, 180.0, 315.0]


def test_solver_failures_of_recoveries_are_counted_apart(limits: PushLimits) -> None:
    """Those of a robot that falls tell nothing: its QP has no solution on the ground."""
    some = trials(limits, [5.0, 10.0], [0.0, 0.0], "random")
    good, bad = outcomes([True, False])
    ends = {"a": [replace(good, solver_failures=3), replace(bad, solver_failures=500)]}
    (entry,) = summarise(some, ends, limits)[0].values()
    assert (entry["solver_failures"], entry["solver_failures_recovered"]) == (503, 3)


def test_the_envelope_finds_the_impulse_that_was_put_in(limits: PushLimits) -> None:
    """J50 of each direction, its mean, η and the paired gain are those of a known threshold."""
    impulses = np.tile(np.linspace(8.0, 30.0, 45), 2)
    angles = np.repeat([0.0, 180.0], 45)
    threshold = np.where(angles == 0.0, 20.0, 16.0)
    results = {
        "base": outcomes((impulses < threshold).tolist()),
        "better": outcomes((impulses < 1.25 * threshold).tolist()),
    }
    entries, (pair,) = summarise(
        trials(limits, impulses.tolist(), angles.tolist()), results, limits
    )
    base = entries["base"]
    assert base["j50_mean"] == pytest.approx(18.0, abs=0.4)
    assert base["j50_min"] == pytest.approx(16.0, abs=0.4)
    assert base["j50_mean_ci95"][0] < 18.0 < base["j50_mean_ci95"][1]
    forward = base["directions"][0]
    assert forward["direction"] == 0.0 and forward["trials"] == 45
    assert forward["eta"] == pytest.approx(forward["j50"] / limits.ankle(0.0, 0.1))
    assert base["eta_min"] == min(d["eta"] for d in base["directions"])
    assert pair["j50_gain"] == pytest.approx(0.25, abs=0.03)
    assert pair["j50_gain_ci95"][0] < 0.25 < pair["j50_gain_ci95"][1]
    assert [d["direction"] for d in pair["directions"]] == [0.0, 180.0]


def test_shares_of_the_step_limits_are_added_and_nothing_else_changes(limits: PushLimits) -> None:
    """Only for controllers that step; all other figures keep their bits."""
    impulses, angles = np.tile(np.linspace(8.0, 30.0, 12), 2), np.repeat([0.0, 112.5], 12)
    some = trials(limits, impulses.tolist(), angles.tolist())
    results = {name: outcomes((impulses < at).tolist()) for name, at in (("a", 15.0), ("b", 21.0))}
    own = NStepLimit(limits, StepLimits(speed=0.55))
    before, _ = summarise(some, results, limits)
    found, _ = summarise(some, results, limits, {"b": own})
    entry = found["b"]
    for d in entry["directions"]:
        assert d["step_limit_2"] == own(d["direction"], 0.1, 2)
        assert d["step_share_2"] == d["j50"] / d["step_limit_2"]
    assert entry["step_share_1_mean"] > entry["step_share_inf_mean"] > 0.0

    def less(value):
        if isinstance(value, dict):
            return {k: less(v) for k, v in value.items() if not k.startswith("step_")}
        return [less(v) for v in value] if isinstance(value, list) else value

    assert less(found) == less(before) and found["a"] == before["a"]
    random = trials(limits, impulses.tolist(), angles.tolist(), "random")
    assert summarise(random, results, limits, {"b": own}) == summarise(random, results, limits)


def test_without_pushes_there_is_no_j50(limits: PushLimits) -> None:
    """A quiet suite counts falls and drift alone."""
    quiet = [replace(OUTCOME, com_drift=d, mean_abs_action=0.01) for d in (0.001, 0.004)]
    entries, pairs = summarise([Trial(0, 0), Trial(1, 1)], {"a": quiet}, limits)
    entry = entries["a"]
    assert entry["com_drift_max"] == 0.004 and entry["mean_abs_action"] == 0.01
    assert "j50_mean" not in entry and "fraction50" not in entry and pairs == []


def test_steps_are_counted_and_feet_in_place_apart(limits: PushLimits) -> None:
    """A recovery with feet in place has neither a touchdown nor a foot that slid."""
    four = [
        OUTCOME,
        replace(OUTCOME, foot_displaced=True, steps=2),
        replace(OUTCOME, foot_displaced=True),  # slid
        replace(OUTCOME, recovered=False, fallen=True, foot_displaced=True, steps=5),
    ]
    entry = summarise([Trial(i, i) for i in range(4)], {"a": four}, limits)[0]["a"]
    assert entry["recovered"] == 3 and entry["recovered_in_place"] == 1
    assert entry["recovered_with_step"] == 2
    assert entry["steps_mean"] == 7 / 4 and entry["steps_max"] == 5
    assert entry["never_fell_rate"] == 0.75 and entry["fallen"] == 1
    assert entry["never_fell_ci95"][0] < 0.75 < entry["never_fell_ci95"][1]


def test_pushes_one_after_the_other_have_no_direction(limits: PushLimits) -> None:
    """Falls are counted; no J50 is fitted to the first push of many."""
    push = Push("torso", 0.5, 0.1, 10.0, 0.0)
    both = (push, replace(push, start=2.0))
    many = [Trial(i, i, both, part="sequence") for i in range(2)]
    results = {"a": [OUTCOME, replace(OUTCOME, recovered=False, fallen=True)]}
    entry = summarise(many, results, limits)[0]["a"]
    assert entry["never_fell_rate"] == 0.5 and "fraction50" not in entry


def test_plain_is_json_of_any_reader(limits: PushLimits) -> None:
    """No NaN, no NumPy, no tuples."""
    value = {"a": np.float64(1.5), "b": (np.int64(2), float("nan")), "c": [float("inf"), None]}
    assert plain(value) == {"a": 1.5, "b": [2, None], "c": [None, None]}
    json.dumps(plain(value), allow_nan=False)


def test_feet_and_lean_of_a_robot_that_only_stands(limits: PushLimits) -> None:
    """The largest of the trials without a push; of pushed ones there is none."""
    quiet = [replace(OUTCOME, com_drift=0.0, foot_drift=d, final_lean=100.0 * d)
             for d in (0.001, 0.03)]  # fmt: skip
    entry = summarise([Trial(0, 0), Trial(1, 1)], {"a": quiet}, limits)[0]["a"]
    assert entry["foot_drift_max"] == 0.03 and entry["unpushed_lean_max"] == 3.0
    entry = summarise([Trial(0, 0)], {"a": [replace(OUTCOME, final_lean=2.0)]}, limits)[0]["a"]
    assert entry["foot_drift_max"] is None and entry["unpushed_lean_max"] is None


def test_a_level_at_which_nothing_is_recovered_has_only_a_bound(limits: PushLimits) -> None:
    """At most the smallest push, in the terminal too, without an interval or a share that is
    kept."""
    impulses = [10.0, 20.0, 30.0, 40.0]
    aimed = [trial for part in ("envelope", "envelope@field")
             for trial in trials(limits, impulses, [0.0] * 4, part)]  # fmt: skip
    quiet = [Trial(9, 9, (), part=part) for part in ("quiet", "quiet@field")]
    won = outcomes([True, True, False, False, False, False, False, False, True, False])
    plan = TrialPlan(Suite(quiet=Quiet(), levels=("field",)), limits, 0, ("a",))
    entry = controller_entry(list(zip([*aimed, *quiet], won, strict=True)), plan)
    own, field = entry["levels"]
    assert own["j50_mean_bound"] is None and field["j50_mean_bound"] == "upper"
    assert (own["j50_bounded"], field["j50_bounded"]) == (0, 1)
    assert field["j50_kept"] is None and field["j50_kept_ci95"] is None
    assert J50_MEAN.text(field) == "≤ 10.0" and J50_MEAN.text(own).endswith("]")
    assert J50_KEPT.text(field) == "–"
    older = {key: value for key, value in field.items() if key != "j50_mean_bound"}
    assert J50_MEAN.text(older) == "10.0"  # an interval without a width says nothing


def test_falls_before_the_push_are_counted(limits: PushLimits) -> None:
    """The push is at 0.5 s; without any there is no count."""
    some = trials(limits, [10.0, 20.0, 30.0], [0.0] * 3)
    fell = [replace(each, fall_time=t) for each, t in zip(outcomes([False] * 3), (0.08, 0.5, 0.49),
                                                          strict=True)]  # fmt: skip
    entries, _ = summarise(some, {"a": fell, "b": outcomes([True] * 3)}, limits)
    assert entries["a"]["fell_before_push"] == 2 and "fell_before_push" not in entries["b"]


def test_a_level_keeps_a_share_of_an_estimate(limits: PushLimits) -> None:
    """The ratio of the two J50s where neither is a bound."""
    aimed = [trial for part in ("envelope", "envelope@field")
             for trial in trials(limits, [10.0, 20.0, 30.0, 40.0], [0.0] * 4, part)]  # fmt: skip
    quiet = [Trial(9, 9, (), part=part) for part in ("quiet", "quiet@field")]
    won = outcomes([True, True, True, False, True, True, False, False, True, True])
    plan = TrialPlan(Suite(quiet=Quiet(), levels=("field",)), limits, 0, ("a",))
    own, field = controller_entry(list(zip([*aimed, *quiet], won, strict=True)), plan)["levels"]
    assert field["j50_kept"] == pytest.approx(field["j50_mean"] / own["j50_mean"])
    assert field["j50_kept"] < 0.8 and field["j50_kept_ci95"] is not None
