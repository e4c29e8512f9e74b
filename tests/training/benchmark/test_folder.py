"""training/benchmark/folder.py."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError, PoiseError
from poise.training.benchmark.case import Result, failed
from poise.training.benchmark.folder import (
    FORMAT,
    BenchmarkFolder,
    BenchmarkSettings,
    read_benchmark_settings,
)
from poise.training.evaluation.folder import EvaluationFolder
from tests.training.evaluation.test_folder import OUTCOME
from tests.training.evaluation.test_folder import SETTINGS as EVALUATION

SETTINGS = BenchmarkSettings(
    benchmark=FORMAT, suite_name="quick", suite={"duration": 5.0}, robot="humanoid",
    robot_fingerprint="abc", seed=3, versions={"mujoco": "3.17.0"}, controllers={"pd": "1"},
)  # fmt: skip
RESULT = Result(OUTCOME, sway=0.1 + 0.2, sway_recovery=None)


def start(path: Path, **changes: object) -> BenchmarkFolder:
    return BenchmarkFolder(path, replace(SETTINGS, **changes))


def test_finished_trials_come_back_exactly(tmp_path: Path) -> None:
    """After a stop and after the end; the log stays."""
    folder = start(tmp_path)
    folder.append("pd", 4, RESULT)
    folder.append("pd", 2, failed(RuntimeError("no")))
    folder.close()
    expected = {("pd", 4): RESULT, ("pd", 2): failed(RuntimeError("no"))}
    again = start(tmp_path)
    assert again.finished == expected and again.damaged == 0
    again.finish([], {"benchmark": FORMAT})
    assert start(tmp_path).finished == expected


def test_controllers_are_added_and_kept(tmp_path: Path) -> None:
    """A folder takes more controllers; those that it has stay in its settings, in order."""
    folder = start(tmp_path)
    folder.append("pd", 0, RESULT)
    folder.close()
    more = start(tmp_path, controllers={"abe07": "2"})
    assert more.settings.controllers == {"pd": "1", "abe07": "2"} and ("pd", 0) in more.finished
    more.close()
    assert read_benchmark_settings(tmp_path).controllers == {"pd": "1", "abe07": "2"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"suite_name": "full"}, "suite_name: holds a benchmark with suite_name 'quick', not"),
        ({"suite": {"duration": 6.0}}, r"suite: holds a benchmark with other suite \(duration\)"),
        ({"seed": 4}, "seed: holds a benchmark with seed 3, not 4"),
        ({"versions": {"mujoco": "3.18.0"}}, r"versions \(mujoco 3.17.0, not 3.18.0\)"),
        ({"robot_fingerprint": "def"}, "robot_fingerprint 'abc', not 'def'"),
        ({"controllers": {"pd": "2"}}, "trials of another 'pd', which has changed since"),
    ],
)
def test_other_benchmarks_do_not_mix(tmp_path: Path, changes: dict, message: str) -> None:
    """The text says what differs and what to do; the folder stays as it was."""
    folder = start(tmp_path)
    folder.append("pd", 0, RESULT)
    folder.close()
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ConfigError, match=f"{message}.*choose another folder"):
        start(tmp_path, **changes)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_evaluation_is_no_benchmark(tmp_path: Path) -> None:
    """Nor is a folder of another format, or of something else."""
    EvaluationFolder(tmp_path, EVALUATION).close()
    with pytest.raises(ConfigError, match="settings.yaml: is not of poise benchmark"):
        start(tmp_path)
    (tmp_path / "settings.yaml").write_text("benchmark: 99\n")
    with pytest.raises(ConfigError, match="is of format 99, this version of Poise reads 1"):
        start(tmp_path)
    (tmp_path / "settings.yaml").unlink()
    with pytest.raises(ConfigError, match="holds files of something else"):
        (tmp_path / "summary.json").write_text("{}")
        start(tmp_path)


def test_missing_and_cut_off_logs(tmp_path: Path) -> None:
    """A cut line is counted and left out; a finished folder without its log is refused."""
    folder = start(tmp_path)
    folder.append("pd", 0, RESULT)
    folder.append("pd", 1, RESULT)
    folder.finish([], {})
    log = tmp_path / "trials.jsonl"
    log.write_bytes(log.read_bytes()[:-30])
    cut = start(tmp_path)
    assert list(cut.finished) == [("pd", 0)] and cut.damaged == 1
    cut.close()
    log.unlink()
    with pytest.raises(ConfigError, match="trials.jsonl: is missing"):
        start(tmp_path)


def test_two_runs_do_not_write_to_one_folder(tmp_path: Path) -> None:
    """The second is refused until the first has stopped, also with --overwrite."""
    first = start(tmp_path)
    for overwrite in (False, True):
        with pytest.raises(PoiseError, match=f"process {os.getpid()} .*is writing there"):
            BenchmarkFolder(tmp_path, SETTINGS, overwrite)
    first.append("pd", 0, RESULT)
    first.close()
    assert list(start(tmp_path).finished) == [("pd", 0)]


def test_overwrite_removes_only_what_is_ours(tmp_path: Path) -> None:
    """Files of others stay."""
    (tmp_path / "notes.txt").write_text("mine")
    start(tmp_path).finish([], {})
    folder = BenchmarkFolder(tmp_path, replace(SETTINGS, seed=9), overwrite=True)
    folder.close()
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"notes.txt", "settings.yaml", "trials.jsonl"} and not folder.finished
