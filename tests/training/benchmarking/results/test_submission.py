"""training/benchmarking/results/submission.py: a result packed for the leaderboards."""

from __future__ import annotations

import hashlib
import json
import re
import zipfile
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.training.benchmarking.results import submission
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.submission import MANIFEST, PACKED, pack_submission
from poise.training.cli.entry import main
from poise.training.running.files import SETTINGS, TRIALS
from tests.support.report_folders import copied


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small result whose suite counts as one of the leaderboards'."""
    made = copied("benchmark", tmp_path)
    monkeypatch.setattr(submission, "SUITES", (load_results(made).settings.suite_name,))
    return made


def test_only_figures_are_packed(folder: Path) -> None:
    """Twice the same bytes, with the sums of what is in them, and no other file of the folder."""
    (folder / "mine.py").write_text("print()")
    packed = pack_submission(folder)
    first = packed.read_bytes()
    assert packed == folder.with_suffix(".zip") and pack_submission(folder).read_bytes() == first
    with zipfile.ZipFile(packed) as archive:
        assert sorted(archive.namelist()) == sorted([*PACKED, MANIFEST])
        told = json.loads(archive.read(MANIFEST))
        sums = {name: hashlib.sha256(archive.read(name)).hexdigest() for name in PACKED}
    assert told["sha256"] == sums and told["seed"] == 2
    assert sum(told["trials"].values()) == len(load_results(folder).records)


def test_what_no_leaderboard_takes_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Another suite, a suite that was changed, an error of a controller: one line each."""
    settings, trials = folder / SETTINGS, folder / TRIALS
    before = settings.read_text()
    settings.write_text(re.sub(r"  interval: .*", "  interval: 0.7", before, count=1))
    with pytest.raises(ConfigError, match="settings.yaml: suite: is not .* as it is packaged"):
        pack_submission(folder)
    settings.write_text(before)
    lines = trials.read_text().splitlines()
    column = lines[0].split(",").index("error")
    row = lines[1].split(",")
    lines[1] = ",".join([*row[:column], "boom", *row[column + 1 :]])
    trials.write_text("\n".join(lines) + "\n")
    with pytest.raises(ConfigError, match="trials.csv: error: .* raised an error in trial 0"):
        pack_submission(folder)
    monkeypatch.setattr(submission, "SUITES", ("standard",))
    assert main(["benchmark", "--submit", str(folder)]) == 2
    assert "no leaderboard is of this suite (choices: standard)" in capsys.readouterr().err
    assert main(["benchmark"]) == 2
    assert "benchmark: needs --out PATH" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.zip"))
