"""What a command is to write is refused before anything is compiled or loaded for long."""

from __future__ import annotations

from pathlib import Path

import pytest

from poise.baselines import warmup
from poise.training.benchmarking.evaluation.folder import ResultFolder
from poise.training.cli.entry import main
from tests.training.benchmarking.evaluation.test_folder import SETTINGS

FOLDERS = (
    "evaluate zero", "benchmark --controllers zero", "train", "train --seeds 0 1", "tune", "demo",
    "demo --full", "qp-set", "gait --compare lip", "export residual",
)  # fmt: skip
FILES = {
    "evaluate zero --write-limits": "write_limits", "walk --video": "video",
    "motion follow squat --out": "out", "robot humanoid --out": "out",
    "robot humanoid --picture": "picture",
}  # fmt: skip


@pytest.fixture
def cold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, where kernels cannot be made ready; it holds the file `file`."""

    def compiles(*_: object) -> None:
        raise AssertionError("compiles")

    monkeypatch.setattr(warmup, "fill_cache", compiles)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder.mp4").mkdir()
    return tmp_path


def refused(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The one line of a command that is refused."""
    assert main(command.split()) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


@pytest.mark.parametrize("command", FOLDERS)
def test_folders(command: str, cold: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file instead of it, and a file above it."""
    assert "file: out: is not a folder" in refused(f"{command} --out file", capsys) or (
        command == "demo --full"  # which has folders in it
    )
    assert "cannot be written (Not a directory)" in refused(f"{command} --out file/a", capsys)
    for empty in (["--out="], ["--out", ""]):  # a variable that is not set
        assert main([*command.split(), *empty]) == 2
        assert capsys.readouterr().err == "poise: out: must not be empty\n"
    assert sorted(path.name for path in cold.iterdir()) == ["file", "folder.mp4"]


@pytest.mark.parametrize("command", FILES)
def test_files(command: str, cold: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder instead of it."""
    error = refused(f"{command} folder.mp4", capsys)
    assert f"folder.mp4: {FILES[command]}: is a folder" in error


def test_a_result_of_something_else(cold: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What other settings were for is told before the controllers are loaded."""
    (cold / "mine").mkdir()
    (cold / "mine/trials.csv").write_text("of something else")
    assert "mine: out: holds files of something else" in refused("evaluate zero --out mine", capsys)
    ResultFolder(cold / "other", SETTINGS).close()
    error = refused("evaluate zero --suite random --out other --seed 7", capsys)
    assert "settings.yaml: suite: holds a result with other suite" in error


@pytest.mark.parametrize("option", ["--video", "--report=page.html", "--out"])
def test_motions_are_drawn_without_a_display(option, monkeypatch):
    """What draws is chosen before a sub-command imports MuJoCo, and only where a picture is due."""
    order = []
    monkeypatch.setattr("poise.envs.viewing.gl.choose_gl_backend", lambda: order.append("gl"))
    monkeypatch.setattr(
        "poise.training.cli.entry.load_extra",
        lambda kind, name: lambda given: order.append(name) or 0,
    )
    assert main(["motion", "play", "squat", option]) == 0
    assert order == (["motion"] if option == "--out" else ["gl", "motion"])
