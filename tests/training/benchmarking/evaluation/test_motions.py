"""The suite that performs motions, from the files of motions to the report."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rich.console import Console

import poise.training.benchmarking.evaluation.run as run_module
from poise.baselines.balance.references.robot_clip import read_robot_clip
from poise.envs.physics.pushes.push import Push
from poise.training.benchmarking.evaluation.evaluate import evaluate
from poise.training.benchmarking.evaluation.tables import print_summary
from poise.training.benchmarking.metrics.motions import in_motion, motion_levels
from poise.training.benchmarking.results.replay import replay
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.motion.following.repertoire import load_repertoire
from poise.training.pictures.report.page import write_report
from tests.support.evaluations import InProcess, write_suite
from tests.support.physics import robot_named
from tests.support.refused import invalid
from tests.support.robot_motions import raised_arm

SMALL: dict[str, Any] = {
    "motions": {
        "directions": 1, "shares": [0.0, 0.5, 2.5],
        "standing": {"fractions": [0.3, 2.2], "first_trials": 2},
    }
}  # fmt: skip


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> Iterator[type[InProcess]]:
    monkeypatch.setattr(run_module, "Executor", InProcess)
    monkeypatch.setattr(InProcess, "played", 0)
    monkeypatch.setattr(InProcess, "stop_after", None)
    yield InProcess


def test_a_suite_of_motions_from_file_to_report(
    tmp_path: Path, in_process: type[InProcess], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped and gone on with it is the same; a fall is a fall; it is shown and played again."""
    suite, motion = write_suite(tmp_path, SMALL), raised_arm(tmp_path / "arm.npz")
    given: dict[str, Any] = {"suite": str(suite), "motions": [str(motion)], "workers": 1}
    in_process.stop_after = 3
    with pytest.raises(KeyboardInterrupt):
        evaluate(["momentum-qp"], out=tmp_path / "out", **given)
    in_process.stop_after = None
    summary = evaluate(["momentum-qp"], out=tmp_path / "out", **given)
    assert in_process.played == 5
    rows = list(csv.DictReader((tmp_path / "out" / "trials.csv").open()))
    assert [row["motion"] for row in rows] == ["standing"] * 2 + ["arm"] * 3
    assert [row["share"] for row in rows] == ["", "", "0.0", "0.5", "2.5"]
    assert [row["fallen"] for row in rows[2:]] == ["False", "False", "True"]
    assert 0.0 < float(rows[2]["body_error"]) < 0.01 < float(rows[3]["joint_rms"]) < 0.3
    assert rows[2]["com_drift"] == "" and float(rows[3]["com_error"]) > 0.0

    levels = summary["controllers"]["momentum-qp"]["motions"]
    assert [(level["share"], level["fallen"]) for level in levels] == [(0.0, 0), (0.5, 0), (2.5, 1)]
    assert [level["body_error"] for level in levels] == [
        pytest.approx(float(rows[2]["body_error"])), pytest.approx(float(rows[3]["body_error"])),
        None,
    ]  # fmt: skip
    console = Console(width=200, record=True, file=None, quiet=False)
    with console.capture() as shown:
        print_summary(summary, console)
    assert "0 of 1 [0.0%, 79.3%]" in shown.get() and "J50 in motion" in shown.get()
    page = write_report(tmp_path / "out", films=False).read_text()
    assert 'id="motions-table"' in page and 'id="in-motion-table"' in page

    motion.unlink()  # the folder has it
    assert replay(tmp_path / "out", 3, "momentum-qp").differences == {}


def test_another_motion_is_another_result(tmp_path: Path, in_process: type[InProcess]) -> None:
    """By what the file holds, not by its name; a controller of another kind is refused."""
    shares = {"motions": {**SMALL["motions"], "shares": [0.0]}}
    suite, motion = write_suite(tmp_path, shares), raised_arm(tmp_path / "arm.npz")
    given: dict[str, Any] = {"suite": str(suite), "motions": [str(motion)], "workers": 1}
    with invalid("controller"):
        evaluate(["zero"], out=tmp_path / "out", **given)
    assert not (tmp_path / "out").exists()
    evaluate(["momentum-qp"], out=tmp_path / "out", **given)
    settings = yaml.safe_load((tmp_path / "out" / "settings.yaml").read_text())
    assert list(settings["motions"]) == ["arm"]
    raised_arm(motion, 0.4)
    with invalid("motions", "arm"):
        evaluate(["momentum-qp"], out=tmp_path / "out", **given)


def test_a_clip_is_put_on_the_robot_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = robot_named("humanoid")
    found = load_repertoire(["humanoid_stand", "bow"], ["humanoid_stand", "bow"], robot, tmp_path)
    assert list(found.clips) == ["humanoid_stand"] and set(found.digests) == {
        "humanoid_stand",
        "bow",
    }
    assert found.durations["humanoid_stand"] == found.clips["humanoid_stand"].duration
    found.write(tmp_path)
    stored = read_robot_clip(tmp_path / "motions" / "humanoid_stand.npz")
    assert np.array_equal(stored.qpos, found.clips["humanoid_stand"].qpos)
    monkeypatch.setattr("poise.training.motion.following.repertoire.retarget", None)
    again = load_repertoire(["humanoid_stand"], ["humanoid_stand"], robot, tmp_path)
    assert again.digests["humanoid_stand"] == found.digests["humanoid_stand"]
    with pytest.raises(TypeError):  # it would be put on the robot again
        load_repertoire(["humanoid_stand"], ["humanoid_stand"], robot, tmp_path, fresh=True)


def played(part: str, motion: str, share: float | None, impulse: float, won: bool) -> Any:
    trial = Trial(0, 0, (Push("torso", 1.0, 0.1, impulse, 0.0),), part=part, motion=motion,
                  share=share)  # fmt: skip
    return trial, Outcome(recovered=won, fallen=not won, body_error=impulse)


def test_j50_in_motion_is_over_that_of_standing() -> None:
    """Standing it holds 0.9 of the 20 N·s that shares are of; in motion 0.72 of them."""
    grid = np.linspace(0.3, 1.5, 121)
    stood = [played("standing", "standing", None, 20.0 * x, x < 0.9) for x in grid]
    moved = [played("motions", "bow", float(x), 20.0 * x, x < 0.72) for x in grid]
    standing, bow = in_motion([*stood, *moved])
    assert (standing["motion"], bow["motion"]) == ("standing", "bow")
    assert standing["share50"] == pytest.approx(0.9, abs=0.01)
    assert bow["share50"] == pytest.approx(0.72, abs=0.01)
    assert bow["over_standing"] == pytest.approx(0.8, abs=0.02)
    low, high = bow["over_standing_ci95"] or (0.0, 0.0)
    assert 0.7 < low < 0.8 < high < 0.9
    assert in_motion(moved)[0]["over_standing"] is None and in_motion(stood) == []


def test_levels_are_means_over_those_that_stood() -> None:
    trials = [played("motions", name, 0.5, size, won)
              for name, size, won in (("bow", 1.0, True), ("bow", 3.0, True), ("bow", 9.0, False),
                                      ("squat", 5.0, True))]  # fmt: skip
    bow, squat, every = motion_levels(trials)
    assert (bow["motion"], bow["trials"], bow["fallen"], bow["body_error"]) == ("bow", 3, 1, 2.0)
    assert (squat["motion"], squat["body_error"]) == ("squat", 5.0)
    assert (every["motion"], every["trials"], every["body_error"]) == (None, 4, 3.0)
    assert json.dumps(every)
