"""training/evaluation/folder.py."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.envs.pushes.sampler import LimitTable
from poise.training.evaluation.folder import EvaluationFolder, Settings, read_settings
from poise.training.trials.trial import COLUMNS, Outcome, Trial, row

SETTINGS = Settings(
    suite_name="random",
    suite={"kind": "random", "trials": 3},
    robot="humanoid",
    robot_fingerprint="abc",
    controllers={"momentum-qp": "1", "runs/a": "2"},
    seed=5,
    limits=LimitTable((0.0, 90.0), (16.0, 14.1)),
    versions={"mujoco": "3"},
)
OUTCOME = Outcome(
    recovered=True, fallen=False, fall_time=None, recovery_time=0.1 + 0.2, stepped=False,
    steps=0,
    max_com=1 / 3, max_capture=0.1, min_cop_margin=-1e-17, max_slide=0.0, energy=12.0,
    peak_torque=1.0, saturation=0.25, solver_failures=2, mean_abs_action=None, com_drift=None,
    final_speed=1e-5, root_force=0.0,
)  # fmt: skip
ADVICE = "choose another folder, or replace it by --overwrite"


def start(path: Path, **changes: object) -> EvaluationFolder:
    return EvaluationFolder(path, replace(SETTINGS, **changes))


def test_a_stopped_evaluation_goes_on_exactly(tmp_path: Path) -> None:
    """Outcomes come back bit for bit, under the same settings."""
    folder = start(tmp_path)
    folder.append(2, [OUTCOME, replace(OUTCOME, fallen=True)])
    folder.close()
    assert read_settings(tmp_path) == SETTINGS
    again = start(tmp_path)
    assert again.finished == {2: [OUTCOME, replace(OUTCOME, fallen=True)]}
    again.append(0, [OUTCOME, OUTCOME])
    again.close()
    assert list(start(tmp_path).finished) == [2, 0]


def test_a_line_cut_off_by_a_kill_is_played_again(tmp_path: Path) -> None:
    """Half a line is dropped, and does not spoil the line that follows."""
    folder = start(tmp_path)
    folder.append(0, [OUTCOME, OUTCOME])
    folder.append(1, [OUTCOME, OUTCOME])
    folder.close()
    partial = tmp_path / "trials.partial.jsonl"
    partial.write_text(partial.read_text()[:-20])
    again = start(tmp_path)
    assert list(again.finished) == [0]
    again.append(1, [OUTCOME, OUTCOME])
    again.close()
    assert list(start(tmp_path).finished) == [0, 1]


@pytest.mark.parametrize(
    ("field", "value"),
    [("seed", 6), ("controllers", {"momentum-qp": "other", "runs/a": "2"}), ("limits", None)],
)
def test_other_settings_do_not_mix(tmp_path: Path, field: str, value: object) -> None:
    """The text names what differs and what to do; the folder stays as it was."""
    folder = start(tmp_path)
    folder.append(0, [OUTCOME, OUTCOME])
    folder.close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ConfigError, match=f"{field}.*{ADVICE}"):
        start(tmp_path, **{field: value})
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_finished_evaluation_is_not_written_over(tmp_path: Path) -> None:
    """Not even by the same settings; --overwrite replaces it, files of others stay."""
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "report.html").write_text("of before")
    folder = start(tmp_path)
    folder.append(0, [OUTCOME, OUTCOME])
    folder.finish([row(Trial(0, 1), "momentum-qp", OUTCOME)], {"suite": "random"})
    assert not (tmp_path / "trials.partial.jsonl").exists()
    with pytest.raises(ConfigError, match=f"already holds an evaluation: {ADVICE}"):
        start(tmp_path)
    EvaluationFolder(tmp_path, SETTINGS, overwrite=True).close()
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"notes.txt", "settings.yaml", "trials.partial.jsonl"}


def test_a_summary_of_something_else_is_not_written_over(tmp_path: Path) -> None:
    """Files of these names without settings were written by another program."""
    (tmp_path / "summary.json").write_text("{}")
    with pytest.raises(ConfigError, match="already holds an evaluation"):
        start(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_trials_csv_reads_back_exactly(tmp_path: Path) -> None:
    """Numbers are written so that the same bits are read."""
    folder = start(tmp_path)
    folder.finish([row(Trial(0, 1), "momentum-qp", OUTCOME)], {"suite": "random"})
    with (tmp_path / "trials.csv").open(newline="") as file:
        (line,) = csv.DictReader(file)
    assert tuple(line) == COLUMNS
    assert float(line["recovery_time"]) == 0.1 + 0.2 and float(line["max_com"]) == 1 / 3
    assert line["recovered"] == "True" and line["fall_time"] == ""
    assert json.loads((tmp_path / "summary.json").read_text()) == {"suite": "random"}


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    """The path of a file is refused, the file stays."""
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ConfigError, match="is not a folder"):
        EvaluationFolder(tmp_path / "file", SETTINGS, overwrite=True)
    assert (tmp_path / "file").read_text() == "mine"
