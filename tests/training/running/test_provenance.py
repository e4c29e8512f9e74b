"""training/running/provenance.py."""

from __future__ import annotations

import subprocess
from pathlib import Path

import mujoco
import pytest

import poise
from poise.configs.texts import LONGEST
from poise.training.running import provenance

ROOT = Path(__file__).parents[3]


def test_versions_are_those_that_run() -> None:
    """What is installed is named, what is not is left out."""
    found = provenance.versions(("mujoco", "no-such-library"))
    assert found["mujoco"] == mujoco.__version__ and found["poise"] == poise.__version__
    assert "no-such-library" not in found


def test_the_commit_is_that_of_the_checkout() -> None:
    """HEAD, with a plus sign where a tracked file differs from it."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    command = ["git", "-C", str(ROOT), "rev-parse", "HEAD"]
    head = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert provenance.commit() in (head, f"{head}+")


def test_an_installed_package_has_no_commit(monkeypatch: pytest.MonkeyPatch) -> None:
    """The repository that a virtual environment lies in is not Poise's own."""
    monkeypatch.setattr(provenance, "__file__", str(ROOT / "a/b/c/provenance.py"))
    assert provenance.commit() is None


@pytest.mark.parametrize("program", ["/home/me/.venv/bin/poise", "/x/training/cli/__main__.py"])
def test_the_command_has_no_folder_of_its_program(
    monkeypatch: pytest.MonkeyPatch, program: str
) -> None:
    """Its arguments are as they were typed."""
    monkeypatch.setattr("sys.argv", [program, "evaluate", "zero", "--out", "my out"])
    assert provenance.command_line() == "poise evaluate zero --out 'my out'"


def test_the_machine_is_named() -> None:
    """Processor and number of cores that may be used."""
    machine = provenance.machine()
    assert machine["processor"] and machine["cores"] == provenance.usable_cores() >= 1


def test_a_long_command_is_cut_to_what_results_may_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """A result with more characters is refused when it is read."""
    monkeypatch.setattr("sys.argv", ["poise", "evaluate", *["walk"] * 2000])
    command = provenance.command_line()
    assert len(command) == LONGEST and command.endswith("…") and " walk walk " in command
