"""training/benchmarking/suites/scenarios.py: everyday trials by name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import load_robot
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome
from poise.training.benchmarking.trials.variants import level_of
from poise.training.cli.entry import main
from tests.support.evaluations import InProcess, write_suite
from tests.support.shared import robot
from tests.support.small_biped import write_biped

PUSH = {
    "duration": 5.0,
    "trials": 2,
    "pushes": {"magnitude": [0.2, 0.4], "unit": "specific_impulse"},
}
EACH: dict[str, Any] = {
    "quiet": {"duration": 4.2, "trials": 1},
    "push": PUSH,
    "arms": {**PUSH, "realism": "arms"},
    "payload": {**PUSH, "realism": "hand-load"},
    "walk": {**PUSH, "trials": 1, "command": {"ahead": 0.3}},
}
SUITE = {"duration": 5.0, "scenarios": {"each": EACH}}


def planned(standing: tuple[str, ...] = ()) -> TrialPlan:
    return TrialPlan(load_suite("scenarios"), PushLimits(robot()), 3, ("a", "b"), standing=standing)


def test_equal_pushes_meet_arms_and_loads() -> None:
    """The same start and push, trial by trial; lengths and levels are the scenarios' own."""
    cells: dict[str, list[Any]] = {}
    for trial in planned().first:
        cells.setdefault(str(trial.level), []).append(trial)
    for name, level in (("arms", "arms"), ("payload", "hand-load")):
        assert [t.conditions.realism for t in cells[name]] == [level] * 16
        for one, other in zip(cells["push"], cells[name], strict=True):
            assert (one.seed, one.pushes, one.until) == (other.seed, other.pushes, other.until)
    assert len({trial.pushes for trial in cells["push"]}) == 16
    for trial in cells["repeated"]:
        assert 4 < len(trial.pushes) < 12 and trial.pushes[-1].start < trial.until - 4.0
    for trial in cells["in-step"]:
        first, second = trial.pushes
        assert 0.15 <= second.start - first.start - first.duration <= 0.4
        assert second.impulse < first.impulse


def test_a_level_of_the_suite_has_the_scenarios_own_on_top() -> None:
    """The same trials, in `field` besides; whose level is none but `field` say so."""
    suite = replace(load_suite("scenarios"), realism="field")
    there = TrialPlan(suite, PushLimits(robot()), 3, ("a", "b")).first
    on_top = {"arms": "field+arms", "payload": "field+hand-load"}
    for one, other in zip(planned().first, there, strict=True):
        assert other.conditions.realism == on_top.get(str(other.level), "field")
        level = level_of(other.conditions)
        assert level.latency == load_realism("field").latency
        assert level.motors.arms == level_of(one.conditions).motors.arms
        assert level.body.hand == level_of(one.conditions).body.hand
        assert (one.seed, one.pushes, one.until) == (other.seed, other.pushes, other.until)


def test_who_does_not_walk_plays_the_others() -> None:
    plan = planned(standing=("b",))
    everything = planned()
    won = Outcome(recovered=True, fallen=False)
    trials = plan.trials({(n, trial.number): won for n in plan.names for trial in everything.first})
    assert [trial.level for trial in trials["a"]] == [t.level for t in everything.first]
    assert {trial.level for trial in trials["b"]} == {*load_suite("scenarios").scenarios.each} - {
        "walk"
    }
    assert plan.count == everything.count - 16 == sum(map(len, trials.values()))


def test_a_result_is_the_same_in_any_order_and_is_played_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By this process, in reverse, and by another: the same bytes. A trial ends when it says."""
    suite = tmp_path / "suite.yaml"
    suite.write_text(yaml.safe_dump(SUITE, sort_keys=False))
    names = ("momentum-qp", "walk")
    summary = evaluate(names, suite, out=tmp_path / "a", seed=4, workers=1)
    monkeypatch.setattr("poise.training.benchmarking.evaluation.run.Executor", InProcess)
    evaluate(names, suite, out=tmp_path / "b", seed=4)
    tables = [(tmp_path / each / "trials.csv").read_bytes() for each in "ab"]
    assert tables[0] == tables[1]
    walker, still = (summary["controllers"][name]["scenarios"] for name in ("walk", "momentum-qp"))
    assert [each["scenario"] for each in walker] == [*EACH]
    assert [each["scenario"] for each in still] == [*EACH][:-1]
    assert all(each["trials"] == EACH[each["scenario"]]["trials"] for each in walker)
    results = load_results(tmp_path / "a")
    told = {record.trial: record.line for record in results.of("walk")}
    assert '"arms": 0.' in told[3]["randomised"] and '"hand": 0.0' in told[5]["randomised"]
    assert told[1]["randomised"] == "" and told[0]["until"] == "4.2"
    assert told[0]["fallen"] == "False"
    lasted = float(told[0]["energy"]) / float(told[0]["mean_power"])
    assert lasted == pytest.approx(4.2, abs=0.01)
    assert told[1]["impulse"] == told[3]["impulse"] == told[5]["impulse"]
    assert told[1]["energy"] != told[3]["energy"] != told[5]["energy"]
    assert not replay(tmp_path / "a", 3, "walk").differences


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"duration": 3.0}, "duration: a scenario lasts 5 s"),
        ({"quiet": {"trials": 2}}, "scenarios: must be the only part"),
        ({"scenarios": {"each": {}}}, "each: must not be empty"),
        ({"scenarios": {"each": {"a": {"duration": 4.0}}}}, "duration: must be above 4"),
        ({"scenarios": {"each": {"a": {"realm": "arms"}}}}, "a.realm: unknown field"),
        (
            {"scenarios": {"each": {"a": {"pushes": {**PUSH["pushes"], "unit": "delta_v"}}}}},  # type: ignore[dict-item]
            "pushes: they are forces",
        ),
        ({"scenarios": {"each": {"a": {"later": [1.0, 0.5]}}}}, "later: the range"),
        ({"scenarios": {"each": {"a": {"duration": 5.0, "realism": "arm"}}}}, "arms"),
    ],
)
def test_wrong_fields_are_named(tmp_path: Path, change: dict[str, Any], says: str) -> None:
    path = write_suite(tmp_path, {**SUITE, **change})
    with pytest.raises(ConfigError, match=says):
        TrialPlan(load_suite(path), PushLimits(robot()), 0, ["a"])


def test_a_robot_without_arms_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line, by the level's field and the roles that are lacking; nothing is written."""
    biped, out = write_biped(tmp_path), tmp_path / "out"
    assert load_robot(biped).description.roles.keys().isdisjoint({"shoulder_pitch_left"})
    arguments = ["--suite", "scenarios", "--robot", str(biped), "--out", str(out)]
    assert main(["evaluate", "pd", *arguments]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "arms: motors.arms: the robot" in line and "shoulder_pitch_left" in line
    assert not out.exists()
