"""`poise gait`: training/motion/gaits/compare.py, its tables and its picture."""

import json

import numpy as np
import pytest

from poise.training.benchmarking.evaluation import run as evaluation
from poise.training.benchmarking.trials.trial import Outcome
from poise.training.cli.entry import main
from poise.training.motion.gaits.compare import controller_of, figures_of
from poise.training.motion.gaits.knee_moment import KneeMoment
from poise.training.motion.gaits.stance import Stances
from tests.support.evaluations import InProcess, write_suite

BAND = KneeMoment("x", (0.0, 100.0), (0.2, 0.2), (0.1, 0.1))


def outcome(**figures):
    return Outcome(recovered=True, fallen=False, **figures)


def test_models_mean_packaged_controllers():
    assert controller_of("double") == "walk-double" and controller_of("walk") == "walk"


def test_figures_are_those_of_the_walks_that_stood():
    """Falls count; speeds, knees and costs of a walk that fell do not."""
    outcomes = [
        outcome(speed_ahead=0.5, knee_mean=0.3),
        outcome(speed_ahead=0.6, knee_mean=0.5),
        Outcome(recovered=False, fallen=True, speed_ahead=9.0, knee_mean=9.0),
    ]
    knees = np.stack([np.full(51, 0.4), np.full(51, -0.2)])
    stances = [Stances(knees, np.array([1.2, 1.4]), 0.01), Stances(knees, np.array([1.6]), None)]
    found = figures_of("x", 0.5, outcomes, stances, BAND, 50.0)
    assert (found.starts, found.falls) == (3, 1)
    assert found.speed_ahead == pytest.approx(0.55) and found.knee_mean == pytest.approx(0.4)
    assert found.knee_curve == pytest.approx([0.1] * 51)
    assert found.knee_rmse == pytest.approx(0.1) and found.knee_stance == pytest.approx(0.3)
    assert found.force_peak == pytest.approx(1.4) and found.height_amplitude == 0.01


def test_nothing_but_falls_is_told():
    found = figures_of("x", 0.5, [Outcome(recovered=False, fallen=True)], [], BAND, None)
    assert found.falls == 1 and found.knee_curve == () and found.knee_rmse is None


def test_the_command_writes_a_table_a_file_and_a_picture(tmp_path, capsys):
    """Two models from one start: a line for each walk, figures as in the file, curves of both."""
    args = f"gait --compare lip double --out {tmp_path}/g --speeds 0.5 --starts 1 --duration 9"
    assert main(args.split()) == 0
    told = capsys.readouterr().out
    written = json.loads((tmp_path / "g" / "gaits.json").read_text())
    lip, double = written["gaits"]
    assert (lip["controller"], double["controller"]) == ("walk-lip", "walk-double")
    for each in (lip, double):
        assert f"{each['controller']} at 0.5 m/s: fell in 0 of 1" in told
        assert each["speed_ahead"] == pytest.approx(0.5, abs=0.05)
        assert len(each["knee_curve"]) == 51 and each["tick"] > 5.0 and each["j50"] is None
    assert double["knee_mean"] < lip["knee_mean"]
    assert "Winter" in written["human"]["source"]
    assert (tmp_path / "g" / "stance_knee.png").stat().st_size > 10_000


def test_pushes_while_walking_give_j50(tmp_path, capsys, monkeypatch):
    """By a small suite: of each controller, in the table and in the file; the suite's folder."""
    monkeypatch.setattr(evaluation, "Executor", InProcess)
    InProcess.played, InProcess.stop_after = 0, None
    pushed = {"command": {"ahead": 0.5}, "directions": 2, "impulses": [0.05, 1.5],
              "first_trials": 3, "trials": 1, "window": 1.0}  # fmt: skip
    suite = write_suite(tmp_path, {"duration": 10.5, "walk_push": pushed})
    args = f"gait --compare lip --out {tmp_path}/g --speeds 0.5 --starts 1 --duration 8 --push"
    assert main([*args.split(), "--push-suite", str(suite)]) == 0
    (gait,) = json.loads((tmp_path / "g" / "gaits.json").read_text())["gaits"]
    folder = tmp_path / "g" / "walk-push"
    summary = json.loads((folder / "summary.json").read_text())["controllers"]["walk-lip"]
    assert gait["j50"] == pytest.approx(summary["j50_mean"]) and 1.0 < gait["j50"] < 62.0
    assert InProcess.played == 2 * 4 and "J50" in capsys.readouterr().out


def test_a_suite_without_pushes_of_a_walk_gives_no_j50(tmp_path, capsys):
    """One line, before anything is played."""
    args = f"gait --compare lip --out {tmp_path}/g --push --push-suite walk"
    assert main(args.split()) == 2
    assert "push_suite: needs a part walk_push" in capsys.readouterr().err
    assert not (tmp_path / "g").exists()
