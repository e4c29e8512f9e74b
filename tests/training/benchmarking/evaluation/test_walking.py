"""Suites of walks: played, counted, shown; metrics/walking.py and walk_tables.py."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from poise.baselines.walking.schedule import TimedCommand
from poise.envs.physics.pushes.push import Kick, Push
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.evaluation.walk_tables import walk_tables
from poise.training.benchmarking.metrics.walking import phase_figures, walk_levels
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.benchmarking.trials.trial import Outcome, Trial, failed_trial
from poise.training.running.summary import EnvelopeFigures
from tests.support.evaluations import InProcess, write_suite
from tests.support.refused import invalid

SMALL = {
    "duration": 7.0,
    "walk": {"commands": [{"ahead": 0.0}, {"ahead": 0.4}], "trials": 1},
    "walk_kick": {"command": {"ahead": 0.4}, "speeds": [0.05], "trials": 1, "start": 4.0,
                  "window": 0.0},
}  # fmt: skip


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> type[InProcess]:
    """Trials are played in this process."""
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    return InProcess


def test_a_suite_of_walks(tmp_path: Path, in_process: type[InProcess]) -> None:
    """Played and goes on where it was stopped; figures in all files; a trial plays again alike."""
    suite, out, text = write_suite(tmp_path, SMALL), tmp_path / "out", io.StringIO()
    in_process.stop_after = 2
    with pytest.raises(KeyboardInterrupt):
        evaluate(["walk"], suite, out=out, seed=3)
    in_process.stop_after = None
    console = Console(file=text, width=120)
    summary = evaluate(["walk"], suite, out=out, seed=3, console=console)
    assert in_process.played == 3
    stand, walk, kick = summary["controllers"]["walk"]["walks"]
    assert [e["level"] for e in (stand, walk, kick)] == ["stand", "ahead 0.4", "± 0.05 m/s"]
    assert stand["speed_ahead"] is None and stand["recovered"] == 1
    for level in (walk, kick):
        assert level["fallen"] == 0 and level["minutes"] == pytest.approx(7.0 / 60.0)
        assert level["speed_ahead"] == pytest.approx(0.4, abs=0.05)
        step, time = level["step_length"], level["step_time"]
        assert step is not None and time is not None
        assert step / time == pytest.approx(level["speed_ahead"], rel=0.1)
        cost, positive = level["cost_of_transport"], level["positive_cost_of_transport"]
        assert cost is not None and positive is not None and 0.3 < positive < cost < 3.0
        knee, peak = level["knee_mean"], level["knee_peak"]
        assert knee is not None and peak is not None and 0.2 < knee < peak < 2.0
    with (out / "trials.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert json.loads(rows[1]["commands"]) == [{"ahead": 0.4, "left": 0, "turn": 0, "start": 0}]
    assert 0.0 <= float(rows[2]["push_phase"]) < 1.0 and not rows[1]["push_phase"]
    results = load_results(out)
    assert results.trial(results.record("walk", 2)).kicks[0].start == 4.0
    assert not replay(results, 2).differences
    assert "drift" not in text.getvalue()  # of robots that are to stay where they are
    assert "falls a minute" in text.getvalue() and "cost of transport" in text.getvalue()


def test_who_only_stands_is_told_so_before_anything_is_played(
    tmp_path: Path, in_process: type[InProcess]
) -> None:
    """One line with the controllers that walk; no folder is left."""
    with invalid("controller", "'momentum-qp'", "simbicon"):
        evaluate(["walk", "momentum-qp"], "walk", out=tmp_path / "out")
    assert in_process.played == 0 and not (tmp_path / "out").exists()


def test_levels_count_falls_by_the_minute() -> None:
    """Over the time until the fall; figures are means over the trials that have them."""

    def played(level: str, **fields: float | None) -> tuple[Trial, Outcome]:
        fell = fields.get("fall_time") is not None
        trial = Trial(0, 0, part="walk", level=level, commands=(TimedCommand(0.5),))
        return trial, Outcome(recovered=not fell, fallen=fell, **fields)

    trials = [
        played("a", speed_ahead=0.4), played("a", speed_ahead=0.6),
        played("a", fall_time=30.0), played("b", speed_ahead=0.1),
    ]  # fmt: skip
    one, two = walk_levels(trials, 60.0)
    assert one["level"] == "a" and one["trials"] == 3 and one["fallen"] == 1
    assert one["minutes"] == 2.5 and one["falls_per_minute"] == pytest.approx(0.4)
    assert one["falls_per_minute_ci95"] is not None
    low, high = one["falls_per_minute_ci95"]
    assert low == pytest.approx(0.02532 / 2.5, rel=1e-3)
    assert high == pytest.approx(5.5716 / 2.5, rel=1e-3)
    assert one["speed_ahead"] == pytest.approx(0.5) and one["recovered"] == 2
    assert two["fallen"] == 0 and two["falls_per_minute_ci95"][0] == 0.0
    assert walk_levels([(Trial(0, 0, part="quiet"), Outcome(True, False))], 60.0) == []


def test_who_raises_has_not_walked_for_a_minute() -> None:
    """Trials in which the controller raised add no time; without any time there is no rate."""
    trial = Trial(0, 0, part="walk", level="a", commands=(TimedCommand(0.5),))
    broken = (trial, failed_trial(ValueError("no")))
    (level,) = walk_levels([(trial, Outcome(True, False)), broken], 60.0)
    assert level["minutes"] == 1.0 and level["trials"] == 2 and level["falls_per_minute"] == 0.0
    (level,) = walk_levels([broken], 60.0)
    assert level["minutes"] == 0.0
    assert level["falls_per_minute"] is None and level["falls_per_minute_ci95"] is None
    table = walk_tables({"ranking": ["x"], "controllers": {"x": {"walks": [level]}}})  # type: ignore[typeddict-item]
    text = io.StringIO()
    Console(file=text, width=120).print(*table)
    assert "0 of 1" in text.getvalue() and "command" in text.getvalue()
    kicked = {**level, "part": "walk_kick", "level": "1 m/s"}
    table = walk_tables({"ranking": ["x"], "controllers": {"x": {"walks": [kicked]}}})  # type: ignore[typeddict-item]
    (heading, *_) = next(table).columns
    assert heading.header == "kick"


def test_j50_by_phase() -> None:
    """Of a robot whose limit is 30 N·s forward and 15 to the left, by a third less in one phase."""
    rng, played = np.random.default_rng(0), []
    for k in range(1600):
        direction, limit = ((0.0, 30.0), (90.0, 15.0))[k % 2]
        phase, impulse = rng.uniform(), limit * rng.uniform(0.3, 1.7)
        here = limit * (0.67 if 0.25 <= phase < 0.375 else 1.0)
        won = impulse < here * rng.uniform(0.95, 1.05)
        trial = Trial(k, k, (Push("torso", 5.0, 0.1, impulse, direction),), part="walk_push")
        played.append((trial, Outcome(bool(won), not won, push_phase=phase)))
    played.append((played[0][0], Outcome(True, False)))  # pushed before it walked
    unknown = Trial(0, 0, (Push("torso", 5.0, 0.1, 9.0, 180.0),), part="walk_push")
    played.append((unknown, Outcome(True, False, push_phase=0.1)))
    j50s = [
        {"direction": 0.0, "j50": 30.0}, {"direction": 90.0, "j50": 15.0},
        {"direction": 180.0, "j50": 0.0},
    ]  # fmt: skip
    envelope: EnvelopeFigures = {"j50_mean": 22.5, "directions": j50s}  # type: ignore[typeddict-item]
    found = phase_figures(played, envelope)
    assert [entry["phase"] for entry in found] == [(k + 0.5) / 8 for k in range(8)]
    for entry in found:
        expected = 22.5 * (0.67 if entry["phase"] == 0.3125 else 1.0)
        assert entry["j50"] == pytest.approx(expected, rel=0.05)
    assert sum(entry["trials"] for entry in found) == 1600


def test_a_kick_is_no_push() -> None:
    """It is given to the environment behind the pushes, and has no impulse of its own."""
    trial = Trial(0, 0, kicks=(Kick(1.0, 0.5, 0.0),))
    assert trial.push is None and trial.options == {"push": [Kick(1.0, 0.5, 0.0)]}
