"""External policies in the commands: evaluated, benchmarked, refused in one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch

from poise.training.benchmarking.evaluation import run
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.cli.entry import main
from tests.support.benchmarks_small import TRIALS, play_in_process, write_small
from tests.support.evaluations import InProcess, write_suite
from tests.support.policies import linear, write_onnx, write_yaml
from tests.support.rivals import network
from tests.support.shared import robot

QUIET = {"duration": 1.2, "quiet": {"trials": 1}}


def policy(folder: Path, weights: np.ndarray) -> Path:
    """A folder with a policy that holds `compact` in its standing posture, and little more."""
    body = robot("compact")
    write_onnx(folder / "policy.onnx", weights)
    return write_yaml(
        folder / "policy.yaml",
        kind="policy-file",
        joints=list(body.joint_names),
        default=[float(q) for q in body.standing_qpos[7:]],
        stiffness={"*hip*": 400.0, "*knee*": 400.0, "*ankle*": 400.0, "*": 60.0},
        damping={"*hip*": 10.0, "*knee*": 10.0, "*ankle*": 10.0, "*": 2.0},
        action_scale=0.01,
        observations=[{"term": "projected_gravity"}],
    ).parent


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return policy(tmp_path / "theirs", linear(3, len(robot("compact").joint_names)))


@pytest.fixture(autouse=True)
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trials are played in this process."""
    monkeypatch.setattr(run, "Executor", InProcess)


def evaluate(folder: Path, *more: str) -> int:
    suite = write_suite(folder.parent, QUIET)
    return main(["evaluate", str(folder), "--robot", "compact", "--suite", str(suite), "--workers",
                 "1", "--out", str(folder.parent / "out"), *more])  # fmt: skip


def test_a_folder_is_evaluated(folder: Path) -> None:
    """It stands for as long as it is played; its name is the folder as it was typed."""
    assert evaluate(folder) == 0
    summary = json.loads((folder.parent / "out/summary.json").read_text())
    (entry,) = summary["controllers"].values()
    assert entry["never_fell_rate"] == 1.0 and list(summary["controllers"]) == [str(folder)]


def test_a_yaml_file_is_benchmarked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In every cell, delay among them, without an error."""
    play_in_process(monkeypatch)
    out = folder.parent / "out"
    line = ["benchmark", "--controllers", str(folder / "policy.yaml"), "--robot", "compact",
            "--suite", str(write_small(folder.parent)), "--out", str(out),
            "--no-report"]  # fmt: skip
    assert main(line) == 0
    summary = json.loads((out / "summary.json").read_text())
    (entry,) = summary["controllers"].values()
    assert entry["errors"] == 0
    assert len((out / "trials.jsonl").read_text().splitlines()) >= TRIALS


def test_its_fingerprint_is_that_of_its_numbers(folder: Path) -> None:
    """Another network under the same name is another controller; another folder is not."""
    body = robot("compact")
    before = load_agent(str(folder), body).fingerprint
    assert load_agent(str(folder), body).fingerprint == before
    moved = Path(shutil.copytree(folder, folder.parent / "moved"))
    assert load_agent(str(moved), body).fingerprint == before
    write_onnx(folder / "policy.onnx", linear(3, len(body.joint_names), seed=1))
    assert load_agent(str(folder), body).fingerprint != before


def test_nan_ends_the_command_in_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the file, how many numbers, and when; the trial is lost, and the exit code 1."""
    weights = linear(3, len(robot("compact").joint_names))
    weights[:, 3] = np.nan
    policy(folder, weights)
    assert evaluate(folder) == 1
    error = capsys.readouterr().err.splitlines()[-1]
    assert f"{folder / 'policy.onnx'}: action: 1 of 25 numbers are not finite at 0.00 s" in error
    summary = json.loads((folder.parent / "out" / "summary.json").read_text())
    (entry,) = summary["controllers"].values()
    assert entry["errors"] == 1 and entry["never_fell_rate"] == 0.0


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("nowhere", ("no such controller: 'nowhere'", "an ONNX file", "unitree-g1-velocity")),
        ("lost.onnx", ("no such controller: 'lost.onnx'",)),
        ("unitree-g1-velocity", ("unitree-g1-velocity.yaml: joints: 'compact' lacks", "choices")),
    ],
)
def test_what_cannot_play_is_refused(
    folder: Path, name: str, parts: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one line."""
    if name == "unitree-g1-velocity":
        network(name)
    assert main(["evaluate", name, "--robot", "compact", "--out", str(folder.parent / "out")]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts) and error.count("\n") == 1


def test_torchscript_plays_where_it_is_allowed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Typing the folder is not enough."""
    (folder / "policy.onnx").unlink()
    torch.jit.save(torch.jit.trace(torch.nn.Linear(3, 25), torch.zeros(1, 3)), folder / "policy.pt")
    assert evaluate(folder) == 2
    error = capsys.readouterr().err
    assert "runs external code" in error and f"--allow {folder / 'policy.pt'}" in error
    assert evaluate(folder, "--allow", str(folder / "policy.pt")) == 0
