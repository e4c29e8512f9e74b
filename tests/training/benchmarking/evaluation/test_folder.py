"""training/benchmarking/evaluation/folder.py."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from poise.configs.errors import ConfigError, PoiseError
from poise.envs.physics.pushes.sampler import LimitTable
from poise.training.benchmarking.evaluation.folder import ResultFolder, Settings, read_settings
from poise.training.benchmarking.trials.table import COLUMNS, trial_row
from poise.training.benchmarking.trials.trial import Outcome, Trial, failed_trial
from poise.training.running.summary import FORMAT
from tests.support.refused import invalid

SETTINGS = Settings(
    format=FORMAT,
    suite_name="random",
    suite={"duration": 5.0},
    robot="humanoid",
    robot_fingerprint="abc",
    seed=3,
    limits=LimitTable((0.0, 90.0), (16.0, 14.1)),
    versions={"mujoco": "3.17.0"},
    controllers={"pd": "1"},
)
OUTCOME = Outcome(
    recovered=True, fallen=False, fall_time=None, recovery_time=0.1 + 0.2, foot_displaced=False,
    steps=0,
    max_com=1 / 3, max_capture=0.1, min_cop_margin=-1e-17, max_slide=0.0, energy=12.0,
    peak_torque=1.0, saturation=0.25, solver_failures=2, mean_abs_action=None, com_drift=None,
    final_speed=1e-5, root_force=0.0, sway=0.1 + 0.2, sway_recovery=None,
)  # fmt: skip
ADVICE = "choose another folder, or replace it by --overwrite"
SUMMARY: Any = {"format": FORMAT}


def start(path: Path, closed: bool = False, **changes: object) -> ResultFolder:
    return ResultFolder(path, replace(SETTINGS, **changes), closed=closed)


def test_finished_trials_come_back_exactly(tmp_path: Path) -> None:
    """Bit for bit, after a stop and after the end; the log stays."""
    folder = start(tmp_path)
    folder.append("pd", 4, OUTCOME)
    folder.append("pd", 2, failed_trial(RuntimeError("no")))
    folder.close()
    assert read_settings(tmp_path) == SETTINGS
    expected = {("pd", 4): OUTCOME, ("pd", 2): failed_trial(RuntimeError("no"))}
    again = start(tmp_path)
    assert again.finished == expected and again.damaged == 0
    again.finish([], SUMMARY)
    assert start(tmp_path).finished == expected


def test_a_line_cut_off_by_a_kill_is_played_again(tmp_path: Path) -> None:
    """Half a line is counted and dropped, and does not spoil the line that follows."""
    folder = start(tmp_path)
    for number in range(2):
        folder.append("pd", number, OUTCOME)
    folder.close()
    log = tmp_path / "trials.jsonl"
    log.write_text(log.read_text()[:-20])
    again = start(tmp_path)
    assert list(again.finished) == [("pd", 0)] and again.damaged == 1
    again.append("pd", 1, OUTCOME)
    again.close()
    assert list(start(tmp_path).finished) == [("pd", 0), ("pd", 1)]


def test_controllers_are_added_and_kept(tmp_path: Path) -> None:
    """A folder takes more controllers; those that it has stay in its settings, in order."""
    folder = start(tmp_path)
    folder.append("pd", 0, OUTCOME)
    folder.close()
    more = start(tmp_path, controllers={"abe07": "2"})
    assert more.settings.controllers == {"pd": "1", "abe07": "2"} and ("pd", 0) in more.finished
    more.close()
    assert read_settings(tmp_path).controllers == {"pd": "1", "abe07": "2"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"suite_name": "full"}, ("suite_name", "'random'", "'full'")),
        ({"suite": {"duration": 6.0}}, ("suite", "(duration)")),
        ({"seed": 4}, ("seed", "seed 3, not 4")),
        ({"versions": {"mujoco": "3.18.0"}}, ("versions", "mujoco 3.17.0, not 3.18.0")),
        ({"robot_fingerprint": "def"}, ("robot_fingerprint", "'abc', not 'def'")),
        ({"controllers": {"pd": "2"}}, ("controllers", "'pd'")),
        ({"limits": None}, ("limits",)),
        ({"closed": True, "controllers": {"abe07": "2"}}, ("controllers", "(pd, abe07)")),
    ],
)
def test_other_settings_do_not_mix(
    tmp_path: Path, changes: dict[str, Any], message: tuple[str, ...]
) -> None:
    """The text says what differs and what to do; the folder stays as it was. Where trials depend
    on who takes part, nobody can be added."""
    folder = start(tmp_path)
    folder.append("pd", 0, OUTCOME)
    folder.close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with invalid(*message, "--overwrite", source="settings.yaml"):
        start(tmp_path, **changes)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("suite_name: random\nsuite: {kind: random}\n", ("format", "2")),
        ("benchmark: 1\nsuite_name: quick\n", ("format", "--overwrite")),
        ("format: 99\n", ("format", "99", "2")),
        (None, ("out",)),
    ],
)
def test_folders_of_before_and_of_others_are_refused(
    tmp_path: Path, text: str | None, message: tuple[str, ...]
) -> None:
    """On one line that says what to do; nothing is written over."""
    (tmp_path / "summary.json").write_text("{}")
    if text is not None:
        (tmp_path / "settings.yaml").write_text(text)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with invalid(*message):
        start(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_finished_folder_without_its_log_is_refused(tmp_path: Path) -> None:
    """The trials are lost, and the text names the file."""
    start(tmp_path).finish([], SUMMARY)
    (tmp_path / "trials.jsonl").unlink()
    with invalid(None, source="trials.jsonl"):
        start(tmp_path)


def test_two_runs_do_not_write_to_one_folder(tmp_path: Path) -> None:
    """The second is refused until the first has stopped, also with --overwrite."""
    first = start(tmp_path)
    for overwrite in (False, True):
        with pytest.raises(PoiseError, match=f"process {os.getpid()} .*is writing there"):
            ResultFolder(tmp_path, SETTINGS, overwrite)
    first.append("pd", 0, OUTCOME)
    first.close()
    assert list(start(tmp_path).finished) == [("pd", 0)]


def test_overwrite_removes_only_what_is_ours(tmp_path: Path) -> None:
    """The report too; files of others stay."""
    (tmp_path / "notes.txt").write_text("mine")
    start(tmp_path).finish([], SUMMARY)
    (tmp_path / "report.html").write_text("of before")
    folder = ResultFolder(tmp_path, replace(SETTINGS, seed=9), overwrite=True)
    folder.close()
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"notes.txt", "settings.yaml", "trials.jsonl"} and not folder.finished


def test_trials_csv_reads_back_exactly(tmp_path: Path) -> None:
    """Numbers are written so that the same bits are read."""
    start(tmp_path).finish([trial_row(Trial(0, 1), "momentum-qp", OUTCOME)], SUMMARY)
    with (tmp_path / "trials.csv").open(newline="") as file:
        (line,) = csv.DictReader(file)
    assert tuple(line) == COLUMNS
    assert float(line["recovery_time"]) == 0.1 + 0.2 and float(line["max_com"]) == 1 / 3
    assert line["recovered"] == "True" and line["fall_time"] == ""
    assert json.loads((tmp_path / "summary.json").read_text()) == SUMMARY


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    """The path of a file is refused, the file stays."""
    (tmp_path / "file").write_text("mine")
    with pytest.raises(ConfigError, match="is not a folder"):
        ResultFolder(tmp_path / "file", SETTINGS, overwrite=True)
    assert (tmp_path / "file").read_text() == "mine"


def test_what_is_not_ready_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    """It is asked with all controllers, before anything is written, and the lock is given back."""
    start(tmp_path).finish([], SUMMARY)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def refuse(settings: Settings) -> None:
        raise ConfigError(f"not {', '.join(settings.controllers)}")

    with pytest.raises(ConfigError, match="not pd, abe07"):
        ResultFolder(tmp_path, replace(SETTINGS, controllers={"abe07": "2"}), ready=refuse)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
