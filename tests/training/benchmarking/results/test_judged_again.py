"""training/benchmarking/results/judged_again.py: walks of older results, judged by falls."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from poise.configs.errors import ConfigError, PoiseWarning
from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.trials.table import outcome_cells, read_outcome
from poise.training.benchmarking.trials.trial import Outcome
from tests.support.evaluations import InProcess, write_suite

SUITE = {
    "duration": 6.5,
    "walk_push": {"directions": 2, "impulses": [0.1, 1.6], "first_trials": 2, "trials": 1,
                  "start": 3.0, "window": 1.0},
}  # fmt: skip
ADDED = ("own_speed_error", "own_turn_error", "last_speed_error", "last_turn_error")


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A result of today in which some fell."""
    folder = tmp_path_factory.mktemp("walks")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evaluation, "Executor", InProcess)
        patch.setattr(InProcess, "stop_after", None)
        evaluate(["walk", "simbicon"], write_suite(folder, SUITE), out=folder / "out", seed=2)
    return folder / "out"


def older(folder: Path, to: Path) -> Path:
    """What an earlier version would have written where every walk left its command: all trials are
    lost, J50 is a bound, and there are none of the columns and keys of today."""
    shutil.copytree(folder, to)
    with (to / "trials.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    for line in lines:
        line["recovered"] = "False"
        for name in ADDED:
            del line[name]
    with (to / "trials.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, lines[0])
        writer.writeheader()
        writer.writerows(lines)
    summary: dict[str, Any] = json.loads((to / "summary.json").read_text())
    for entry in summary["controllers"].values():
        entry.pop("criterion")
        entry["j50_mean"], entry["recovered"], entry["recovered_rate"] = 0.1, 0, 0.0
    (to / "summary.json").write_text(json.dumps(summary))
    return to


def test_walks_of_an_older_result_are_judged_by_falls(played: Path, tmp_path: Path) -> None:
    """J50, the ranking and pairs are those of today; what was recovered stays; a line says so."""
    now = load_results(played).summary
    assert any(entry["fallen"] for entry in now["controllers"].values())
    with pytest.warns(PoiseWarning, match="older result are judged again, J50 and the order by f"):
        again = load_results(older(played, tmp_path / "old")).summary
    now, again = (json.loads(json.dumps(each)) for each in (now, again))  # tuples are lists then
    assert again["ranking"] == now["ranking"] and again["pairs"] == now["pairs"]
    for name, entry in now["controllers"].items():
        other = again["controllers"][name]
        assert other["j50_mean"] == entry["j50_mean"] > 0.1 and other["recovered"] == 0
        for before, after in zip(entry["directions"], other["directions"], strict=True):
            assert after == {key: before[key] for key in before if not key.startswith("step_")}
        assert other["never_fell_rate"] == entry["never_fell_rate"]
        assert other["fingerprint"] == entry["fingerprint"]


def test_a_robot_that_has_changed_is_said(played: Path, tmp_path: Path) -> None:
    """Then the figures stay those of the older verdict."""
    folder = older(played, tmp_path / "old")
    path = folder / "settings.yaml"
    (mark,) = [line for line in path.read_text().splitlines() if line.startswith("robot_finger")]
    path.write_text(path.read_text().replace(mark, f"robot_fingerprint: {'a' * 64}"))
    with pytest.warns(PoiseWarning, match="not judged again: the robot has changed since"):
        summary = load_results(folder).summary
    assert {entry["j50_mean"] for entry in summary["controllers"].values()} == {0.1}


def test_an_outcome_is_read_back_from_its_line() -> None:
    """Every type of column; what is empty or missing is the default."""
    outcome = Outcome(True, False, 1.25, steps=3, foot_displaced=True, surfaces_passed=2,
                      saturated_motor="knee", last_speed_error=0.125,
                      randomised='{"mass": 1}')  # fmt: skip
    line = {name: "" if cell is None else str(cell) for name, cell in
            outcome_cells(outcome).items()}  # fmt: skip
    assert read_outcome({"trial": "0", **line}, Path("a")) == outcome
    assert read_outcome({"trial": "0", "recovered": "True", "fallen": "False"}, Path("a")) == (
        Outcome(True, False)
    )
    with pytest.raises(ConfigError, match=r"a: trial 0: steps does not parse: 'x'"):
        read_outcome({"trial": "0", **line, "steps": "x"}, Path("a"))
