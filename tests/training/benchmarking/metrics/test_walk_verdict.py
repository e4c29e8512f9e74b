"""Walks are judged by falls: who never fell is not behind who did, in any table."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from poise.baselines.environments.commanded import CommandedEnv
from poise.configs.schema import build
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.evaluation.tables import print_summary, ranked, shared_ranks
from poise.training.benchmarking.metrics.entry import controller_entry, robot_figures
from poise.training.benchmarking.metrics.evaluated import Evaluated
from poise.training.benchmarking.metrics.pairs import pair_figures
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.files import plain
from poise.training.running.summary import Entry, Summary
from tests.support.evaluations import InProcess, write_suite

WALK_PUSH = {"directions": 2, "impulses": [0.06, 1.0], "first_trials": 12, "trials": 6}
FELL, FOLLOWS, OFF = (Outcome(False, True, fall_time=6.0, loss="tilt"), Outcome(True, False),
                      Outcome(False, False, loss="off command"))  # fmt: skip


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot())


def figures(
    limits: PushLimits, part: dict[str, Any], ends: dict[str, Any]
) -> tuple[dict[str, Entry], dict[str, Evaluated], TrialPlan]:
    """Entries of controllers, whose trials end as `ends` says of each."""
    plan = TrialPlan(build(Suite, part, "suite"), limits, 3, tuple(ends))
    known = {(name, t.number): end(t) for t in plan.first for name, end in ends.items()}
    for name, trials in plan.second(known).items():
        known |= {(name, trial.number): ends[name](trial) for trial in trials}
    played: dict[str, Evaluated] = {
        name: [(trial, known[name, trial.number]) for trial in trials]
        for name, trials in plan.trials(known).items()
    }
    return {name: controller_entry(own, plan) for name, own in played.items()}, played, plan


def falls_above(impulse: float, rng: np.random.Generator) -> Any:
    """A walker that follows its command, and falls from pushes of about this size [N·s] on."""

    def end(trial: Trial) -> Outcome:
        most = impulse * rng.uniform(0.8, 1.2)
        return FELL if trial.pushes[0].impulse > most else FOLLOWS

    return end


@pytest.mark.parametrize("trials", [1, 6])
@pytest.mark.parametrize("seed", range(6))
def test_who_never_fell_is_not_behind_who_did(limits: PushLimits, seed: int, trials: int) -> None:
    """Whatever it is commanded: in J50, in all directions and phases, in rank, pairs and gains."""
    rng, mass = np.random.default_rng(seed), limits.robot.mass
    weak = falls_above(mass * rng.uniform(0.1, 1.1), rng)
    part = {"walk_push": {**WALK_PUSH, "trials": trials, "reach": 2.5}}
    entries, played, _ = figures(limits, part, {"weak": weak, "upright": lambda trial: OFF})
    one, two = entries["weak"], entries["upright"]
    assert two["fallen"] == 0 < sum(outcome.fallen for _, outcome in played["weak"])
    assert two["j50_mean"] > one["j50_mean"]
    for aims in zip(one["directions"], two["directions"], strict=True):
        assert aims[1]["j50"] >= aims[0]["j50"]
    assert ranked(entries) == ["upright", "weak"]
    assert shared_ranks(entries) == {"upright": 1, "weak": 2}
    pair = pair_figures("weak", "upright", played, entries)
    assert pair["only_a"] == 0 <= pair["only_b"]
    assert pair["j50_gain"] is None or pair["j50_gain"] > 0.0
    assert two["recovered"] == 0 and two["never_fell_rate"] == 1.0  # a figure of its own


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("walk_kick", {"sizes": [1.0, 2.0], "speeds": [], "trials": 8}),
        ("walk", {"commands": [{"ahead": 0.5}], "trials": 8}),
        ("walk_repeated", {"trials": 8}),
    ],
)
def test_walks_without_a_j50_are_ranked_by_falls(
    limits: PushLimits, name: str, part: dict[str, Any]
) -> None:
    """Kicked, unpushed, pushed again and again; of equal ones who follows its command is first."""
    ends = {
        "falls": lambda trial: FELL if trial.number % 4 == 0 else FOLLOWS,
        "off": lambda trial: OFF,
        "follows": lambda trial: FOLLOWS,
    }
    entries, played, _ = figures(limits, {"duration": 70.0, name: part}, ends)
    assert ranked(entries) == ["follows", "off", "falls"]
    assert shared_ranks(entries) == {"follows": 1, "off": 1, "falls": 3}
    pair = pair_figures("falls", "off", played, entries)
    assert pair["only_a"] == 0 and pair["rate_gain"] == pytest.approx(0.25)
    assert all(level["fallen"] == 0 for level in entries["off"]["walks"])


def test_tables_have_both_figures(limits: PushLimits) -> None:
    """Not fallen, and as commanded again; the count is of the pushes that all meet."""
    rng = np.random.default_rng(0)
    ends = {"weak": falls_above(0.5 * limits.robot.mass, rng), "upright": lambda trial: OFF}
    part = {"walk_push": {**WALK_PUSH, "reach": 2.5}}
    entries, played, _ = figures(limits, part, ends)
    assert {entry["trials"] for entry in entries.values()} == {24}
    assert {len(own) for own in played.values()} == {36}
    summary: Summary = plain({
        "suite": "walk-push", "seed": 3, "robot": robot_figures(limits), "rated": None,
        "scale": limits.scale, "reference": "weak", "ranking": ranked(entries),
        "controllers": entries, "step_limits": [], "seeds": [],
        "pairs": [pair_figures("weak", "upright", played, entries)],
    })  # fmt: skip
    text = io.StringIO()
    print_summary(summary, Console(file=text, width=250))
    table = text.getvalue()
    assert "not fallen" in table and "as commanded again" in table
    assert "100% [86%, 100%]" in table and "0% [0%, 14%]" in table
    assert "gain" in table and "-" not in table.split("J50 gain")[1].split("└")[0].split("│")[-2]


def test_standing_is_still_judged_by_recovery(limits: PushLimits) -> None:
    """J50 and the rank of a standing robot count who comes to rest; falls stand beside them."""
    part = {"grid": {"directions": 2, "magnitudes": [0.2, 0.4], "repeats": 2}}
    quiet = replace(OFF, loss="not quiet")
    ends = {"restless": lambda trial: quiet, "falls": lambda trial: FOLLOWS}
    entries, _, _ = figures(limits, part, ends)
    assert ranked(entries) == ["falls", "restless"]
    assert entries["restless"]["never_fell_rate"] == 1.0
    assert entries["restless"]["criterion"] == "recovered"


def test_a_steady_error_of_its_own_is_not_charged_to_a_push(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`walk` follows 0.35 m/s where 0.5 are commanded, is pushed and kicked a little, and has lost
    nothing: compared with its strides before, and, kicked at 4 s, with the walk without the kick.
    """
    taken = CommandedEnv._commands
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    monkeypatch.setattr(
        CommandedEnv, "_commands",
        lambda env, options: [replace(each, ahead=each.ahead - 0.15)
                              for each in taken(env, options)],
    )  # fmt: skip
    suite = write_suite(tmp_path, {
        "duration": 10.0,
        "walk_push": {"directions": 1, "impulses": [0.05, 0.1], "first_trials": 2, "trials": 1,
                      "start": 5.5, "window": 0.5},
        "walk_kick": {"speeds": [], "sizes": [0.1], "trials": 1, "start": 4.0, "window": 0.0},
    })  # fmt: skip
    monkeypatch.setattr(InProcess, "stop_after", None)
    entry = evaluate(["walk"], suite, out=tmp_path / "out", seed=4)["controllers"]["walk"]
    assert entry["fallen"] == 0 and entry["recovered"] == entry["trials"] == 3
    for level in entry["walks"]:
        for key in ("own_speed_error", "last_speed_error"):
            assert level[key] == pytest.approx(0.15, abs=0.03)
        assert level["speed_error"] == pytest.approx(0.15, abs=0.03)  # where it is charged
