"""training/benchmarking/trials/step_limits.py, and where it is drawn."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from poise.baselines.balance.stepping.planning.config import StepLimits
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config, load_controller
from poise.envs.compiled.maths.pendulum import drifted_point, duration_factor
from poise.training.benchmarking.evaluation import plots
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.evaluation.plots import _step_lines
from poise.training.benchmarking.metrics.entry import controller_entry
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import (
    COUNTS,
    ROOM,
    NStepLimit,
    curves,
    shown_out_to,
    stepping_limits,
)
from poise.training.benchmarking.trials.trial import Outcome
from tests.support.evaluations import ENVELOPE, InProcess, write_suite
from tests.support.shared import robot
from tests.training.benchmarking.evaluation.test_folder import OUTCOME
from tests.training.benchmarking.suites.test_factors import small, won_below


@pytest.fixture(scope="module")
def limit() -> NStepLimit:
    return NStepLimit(PushLimits(robot()))


def test_a_push_at_the_limit_is_stopped_by_that_many_steps(limit: NStepLimit) -> None:
    """The capture point after the push, step after step, ends at the edge of the last foot's
    reach: the recursion that d_N solves."""
    omega, mass, time = limit.limits.omega, robot().mass, limit.steps.time_min / limit.limits.omega
    for direction in (0.0, 70.0, 180.0):
        r, length = limit.reach(direction), limit.length(direction)
        for count in (0, 1, 3):
            J = limit(direction, 1e-9, count)  # a kick
            xi, foot = J / mass / omega, 0.0
            for _ in range(count):
                xi = drifted_point(np.full(2, xi), np.full(2, foot + r), omega, time)[0]
                foot += length
            assert xi - foot == pytest.approx(r, abs=1e-6)
        longer = duration_factor(omega, 0.1)
        assert limit(direction, 0.1, 1) == pytest.approx(limit(direction, 1e-9, 1) * longer)


def test_reach_is_that_of_the_ankles_not_of_the_soles(limit: NStepLimit) -> None:
    """Forward 20 N·m of each ankle hold less than the toes allow; more steps stop more."""
    assert 0.05 < limit.reach(0.0) < limit.limits.margin(0.0)
    assert limit.reach(90.0) > limit.reach(0.0)  # the feet stand apart
    for direction in range(0, 360, 45):
        stopped = [limit(direction, 0.1, count) for count in range(4)]
        assert np.all(np.diff(stopped) > 0.0)


def test_length_is_within_the_box_and_the_speeds(limit: NStepLimit) -> None:
    """A box alone, or a speed alone, gives its own bound."""
    h = robot().height_com
    wide = StepLimits(speed=99.0, side_speed=99.0, ahead=0.5, behind=0.3, width_max=0.4)
    box = NStepLimit(limit.limits, wide)
    found = [box.length(angle) / h for angle in (0.0, 180.0, 90.0)]
    assert found == pytest.approx([0.5, 0.3, 0.4])
    slow = StepLimits(speed=0.2, side_speed=0.1, time_min=1.0)
    assert NStepLimit(limit.limits, slow).length(0.0) / h == pytest.approx(0.2)
    assert NStepLimit(limit.limits, slow).length(90.0) / h == pytest.approx(0.1)


def stander(name: str, count: int, elsewhere: bool = True) -> tuple[Agent, list[Outcome]]:
    """A controller without a planner; in `count` of 20 recoveries a foot landed."""
    env = SimpleNamespace(controller=SimpleNamespace())
    landed = replace(OUTCOME, steps=1, foot_displaced=elsewhere)
    return Agent(name, env, np.asarray, ""), [landed] * count + [OUTCOME] * (20 - count)


def test_the_limits_are_those_of_the_planner() -> None:
    """Of the controller itself, and of the one under a policy; feet in place have none."""
    names = ["zero", "momentum-qp", "ipm-step", "capture-step", "residual-step"]
    agents = [load_agent(name, robot()) for name in names]
    nothing = {name: [replace(OUTCOME, recovered=False)] for name in names}
    found = stepping_limits(agents, nothing, PushLimits(robot()))
    assert list(found) == names[2:]
    for name in ("capture-step", "ipm-step"):
        assert found[name].steps == controller_config(name).limits
    assert found["residual-step"].steps == found["capture-step"].steps
    assert found["ipm-step"].steps != found["capture-step"].steps


def test_without_a_planner_it_is_who_steps_that_counts(limit: NStepLimit) -> None:
    """One step in twenty recoveries is none, nor is a foot that lands where it was; the defaults
    come after what a planner says."""
    own = StepLimits(speed=0.4)
    controller = load_controller("capture-step", robot())
    controller._step_limits = own
    planner = ResidualBalanceEnv(robot(), controller=controller)
    cases = [stander("often", 10), stander("rare", 1), stander("tilts", 10, False)]
    cases.append((Agent("planned", planner, np.asarray, ""), []))
    outcomes = {agent.name: results for agent, results in cases}
    found = stepping_limits([agent for agent, _ in cases], outcomes, limit.limits)
    assert [(name, one.steps) for name, one in found.items()] == [
        ("planned", own), ("often", StepLimits()),
    ]  # fmt: skip


def test_shares_are_of_the_formula() -> None:
    """r, l and T_s of a direction, written out, give the limits and what J50 is of them."""
    pushed, steps = PushLimits(robot()), StepLimits(speed=0.61, side_speed=0.43, time_min=0.83)
    limit = NStepLimit(pushed, steps)
    figures = {"directions": [{"direction": a, "j50": j} for a, j in ((37.0, 21.5), (250.0, 14.0))]}
    limit.add_to(figures, 0.17)
    omega, mass = pushed.omega, robot().mass
    for entry in figures["directions"]:
        r, length, time = (entry[f"step_{name}"] for name in ("reach", "length", "time"))
        assert (r, length) == (limit.reach(entry["direction"]), limit.length(entry["direction"]))
        assert time == pytest.approx(0.83 / omega)
        a = np.exp(-omega * time)
        longer = mass * omega * duration_factor(omega, 0.17)
        for name, d in (
            ("1", r + length * a),
            ("2", r + length * (a + a * a)),
            ("inf", r + length * a / (1.0 - a)),
        ):
            assert entry[f"step_limit_{name}"] == pytest.approx(longer * d, rel=1e-12)
            share = entry["j50"] / (longer * d)
            assert entry[f"step_share_{name}"] == pytest.approx(share, rel=1e-12)
    means = [np.mean([e[f"step_share_{n}"] for e in figures["directions"]]) for n in COUNTS]
    assert [figures[f"step_share_{n}_mean"] for n in COUNTS] == pytest.approx(means)


def test_curves_are_one_for_all_that_step_alike(limit: NStepLimit) -> None:
    """Equal limits share an entry; with several, the lines of a plot say whose they are."""
    slow = NStepLimit(limit.limits, StepLimits(speed=0.2))
    alike, other = curves({"a": limit, "b": slow, "c": limit}, 0.1)
    assert (alike["controllers"], other["controllers"]) == (["a", "c"], ["b"])
    assert StepLimits(**other["steps"]) == slow.steps
    columns = other["curves"]
    assert columns["directions"][7] == 35.0 and len(columns["inf"]) == 72
    assert columns["2"][7] == slow(35.0, 0.1, 2) < alike["curves"]["2"][7]
    assert list(_step_lines({"b": slow}, np.array([35.0]), 0.1)) == [
        "one-step limit", "two-step limit",
    ]  # fmt: skip
    lines = _step_lines({"b": slow, "a": limit}, np.array([35.0]), 0.1)
    assert lines["two-step limit of b"][1] == [columns["2"][7]] and len(lines) == 2
    assert _step_lines({}, np.array([35.0]), 0.1) == {}


def test_a_plot_has_room_for_limits_but_not_for_any() -> None:
    """Limits widen it up to a factor; nearer ones do not narrow it."""
    assert shown_out_to(20.0, [30.0, 42.0]) == 42.0
    assert shown_out_to(20.0, [30.0, 420.0]) == 20.0 * ROOM
    assert shown_out_to(20.0, [12.0]) == shown_out_to(20.0, []) == 20.0


def test_the_envelope_of_one_that_steps_is_measured_by_the_step_limits() -> None:
    """Every direction has limits and shares; without a limit of steps it has neither."""
    plan = small()
    played = [(trial, OUTCOME) for trial in plan.trials(won_below(plan, 1e9))["a"]]
    own = NStepLimit(plan.limits, StepLimits(speed=0.55))
    entry, plain = controller_entry(played, plan, own), controller_entry(played, plan)
    for d, before in zip(entry["directions"], plain["directions"], strict=True):
        assert d["step_limit_1"] == own(d["direction"], plan.suite.push_duration, 1)
        assert d["step_share_1"] == d["j50"] / d["step_limit_1"]
        assert d | before == d and len(d) == len(before) + 9
    assert "step_share_1_mean" in entry and not any("step_share" in key for key in plain)


def test_an_evaluation_draws_and_prints_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The PNG gets the lines of the planner's limits, the table the mean fraction of one."""
    drawn: dict[str, Any] = {}
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    monkeypatch.setattr(InProcess, "stop_after", None)
    monkeypatch.setattr(plots, "polar_envelope", lambda *_, **given: drawn.update(given))
    text, names = io.StringIO(), ["capture-step", "zero"]
    suite, console = write_suite(tmp_path, ENVELOPE), Console(file=text, width=200)
    summary = evaluate(names, suite, out=tmp_path / "out", console=console)
    angles, limit = drawn["step_limits"]["one-step limit"]
    (curve,) = summary["step_limits"]
    assert limit[list(angles).index(40.0)] == curve["curves"]["1"][8]
    entry = summary["controllers"]["capture-step"]
    share = f"{entry['step_share_1_mean']:.2f}"
    rows = [line for line in text.getvalue().splitlines() if "│ capture-step " in line]
    assert f" {share} │" in rows[0] and "step_share_1_mean" not in summary["controllers"]["zero"]
