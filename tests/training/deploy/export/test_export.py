"""The exported folder: whole or not there, its card, and what is refused."""

from __future__ import annotations

import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from poise.configs.errors import PoiseError, WriteError
from poise.training.benchmarking.evaluation import run as run_module
from poise.training.cli.entry import main
from poise.training.deploy.export import export
from poise.training.deploy.export.export import export_policy
from poise.training.deploy.export.onnx_graph import onnx_bytes
from poise.training.learning.policy import load_policy
from poise.training.learning.train import train
from tests.support.evaluations import InProcess
from tests.support.exported import SYMMETRIC, exported, policy, spoiled
from tests.support.shared import finished_run, tiny_config


def test_nothing_is_written_where_the_check_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither the folder nor a part of it."""
    monkeypatch.setattr(
        export, "onnx_bytes", lambda policy, said: onnx_bytes(spoiled(policy, 0, 0.01), said)
    )
    with pytest.raises(PoiseError, match="its actions differ"):
        export_policy(finished_run(), tmp_path / "deep" / "out")
    assert list((tmp_path / "deep").iterdir()) == []


def test_a_policy_has_the_name_of_its_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However its folder is named on the command line."""
    best = tmp_path / "run" / "best"
    best.mkdir(parents=True)
    monkeypatch.chdir(best)
    assert {export._name(path) for path in (best, ".", "../best", "..", best / "..")} == {"run"}
    monkeypatch.chdir(best.parent)
    assert {export._name(path) for path in ("best", "./best/", ".")} == {"run"}
    assert export._name("residual-step") == "residual-step"


def head_of(folder: Path) -> tuple[dict[str, Any], str]:
    _, head, page = (folder / "README.md").read_text().split("---\n", 2)
    return yaml.safe_load(head), page


def test_the_card_is_one_that_hugging_face_reads() -> None:
    """Its figures are those of the run; it names every file that is there."""
    folder = exported()
    head, page = head_of(folder)
    assert head["license"] == "apache-2.0" and head["library_name"] == "stable-baselines3"
    assert {"reinforcement-learning", "stable-baselines3", "poise/ResidualStep-v0"} <= set(
        head["tags"]
    )
    (entry,) = head["model-index"]
    (result,) = entry["results"]
    state = policy(SYMMETRIC).state
    row = next(r for r in state["evaluations"] if r["timesteps"] == state["timesteps"])
    assert {m["type"]: m["value"] for m in result["metrics"]} == {
        key: row[key] for key in ("recovered", "fallen")
    }
    assert result["task"]["type"] == "reinforcement-learning" and result["dataset"]["type"]
    there = {path.name for path in folder.iterdir()} - {"README.md"}
    assert [name for name in there if name not in page] == []
    assert len(re.findall(r"^\| \d+ \|", page, re.M)) == 92 + 13
    figures = json.loads((folder / "results.json").read_text())["figures"]
    assert [figure["value"] for figure in figures] == [row["recovered"], row["fallen"]]


def test_what_was_exported_is_read_by_poise_again() -> None:
    folder = exported()
    again = load_policy(folder / "poise")
    assert again.content() == policy(SYMMETRIC).content() and again.state == policy(SYMMETRIC).state


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of ELU and of a wider critic, whose last checkpoint met no held-out push."""
    out = tmp_path_factory.mktemp("bare") / "my-run"
    ppo = replace(tiny_config().ppo, symmetric=True, activation="elu", critic_arch=(24,))
    train(tiny_config(ppo=ppo, steps=64), out, progress=False)
    state = json.loads((out / "last" / "state.json").read_text())
    state["evaluations"] = state["evaluations"][:1]
    (out / "last" / "state.json").write_text(json.dumps(state))
    return out / "last"


def test_figures_that_nobody_measured_are_not_told(bare: Path, tmp_path: Path) -> None:
    """No model-index, and no licence that nobody gave."""
    export_policy(bare, tmp_path / "out")
    head, page = head_of(tmp_path / "out")
    assert "model-index" not in head and "license" not in head and "| figure" not in page
    assert "# my-run\n" in page
    assert json.loads((tmp_path / "out" / "results.json").read_text())["figures"] == []


def test_figures_of_a_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of this very policy, by its fingerprint; else one line."""
    monkeypatch.setattr(run_module, "Executor", InProcess)
    run = str(finished_run())
    suite = tmp_path / "s.yaml"
    suite.write_text(yaml.safe_dump({"duration": 1.1, "quiet": {"trials": 2}}))
    result = ["--suite", str(suite), "--out", str(tmp_path / "r")]
    assert main(["evaluate", "zero", run, *result]) == 0
    given = ["--result", str(tmp_path / "r"), "--licence", "mit"]
    assert main(["export", run, "--out", str(tmp_path / "out"), *given]) == 0
    assert "differs from the policy by" in capsys.readouterr().out
    head, _ = head_of(tmp_path / "out")
    summary = json.loads((tmp_path / "r" / "summary.json").read_text())
    told = head["model-index"][0]["results"][0]["metrics"]
    metrics = {m["type"]: m["value"] for m in told}
    assert metrics["recovered_rate"] == summary["controllers"][run]["recovered_rate"]
    place = f"suite {suite}, seed 0, robot humanoid"  # names, not all that is known of the robot
    assert {m["name"] for m in told if m["type"] == "recovered_rate"} == {f"recovered, {place}"}
    assert head["license"] == "mit"
    assert main(["export", "residual", "--out", str(tmp_path / "no"), *given]) == 2
    error = capsys.readouterr().err
    assert "summary.json: controllers: this policy took no part" in error
    assert not (tmp_path / "no").exists()


def spoil(folder: Path, name: str) -> Path:
    copied = Path(shutil.copytree(finished_run() / "last", folder / "spoiled"))
    (copied / name).unlink()
    return copied


BAD = {
    "no such policy: 'momentum-qp'": lambda f: ["momentum-qp"],
    "no policy.zip": lambda f: [str(spoil(f, "policy.zip"))],
    "out: is not empty": lambda f: ["residual", "--out", str(finished_run())],
    "out: is not a folder": lambda f: ["residual", "--out", __file__],
    "out: is no name of a file": lambda f: ["residual", "--out", "a\0b"],
    "not a finished result": lambda f: ["residual", "--result", str(f)],
}


@pytest.mark.parametrize("message", BAD)
def test_bad_input_is_one_line(
    message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "out")]
    arguments = BAD[message](tmp_path)
    assert main(["export", *([] if "--out" in arguments else out), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and error.startswith("poise: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["onnx", "onnxruntime", "safetensors"])
def test_a_missing_library_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    assert main(["export", "residual", "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert f"needs the package {name}: pip install -e '.[export]'" in error
    assert error.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_disk_that_refuses_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError):
        export_policy("residual", tmp_path / "file" / "out")
