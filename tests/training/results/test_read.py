"""training/results/read.py and training/results/values.py."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from poise.configs.errors import ConfigError
from poise.training.results.read import load_results
from poise.training.results.values import interval, number
from tests.support.report_folders import copied, finished


def test_the_files_are_read_back() -> None:
    """Every trial of every controller, with its numbers; nothing without a push or a fall."""
    results = load_results(finished("random"))
    summary = json.loads((finished("random") / "summary.json").read_text())
    assert results.controllers == tuple(summary["controllers"]) and len(results.records) == 16
    for name in results.controllers:
        records = results.of(name)
        assert sum(r.recovered for r in records) == summary["controllers"][name]["recovered"]
        assert all(math.isnan(r.fall_time) != r.fallen for r in records)
        assert all(float(r.line["impulse"]) == r.impulse for r in records)


def edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    """Changes a text in a file."""

    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1))

    return change


def cut(name: str, share: float) -> Callable[[Path], None]:
    """Cuts a file off."""

    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        (folder / name).write_text(text[: int(share * len(text))])

    return change


def summary(**changes: object) -> Callable[[Path], None]:
    """Changes entries of the first controller in the summary."""

    def change(folder: Path) -> None:
        path = folder / "summary.json"
        data = json.loads(path.read_text())
        next(iter(data["controllers"].values())).update(changes)
        path.write_text(json.dumps(data))

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda folder: (folder / "summary.json").unlink(), "summary.json missing"),
        (lambda folder: (folder / "trials.csv").unlink(), "trials.csv missing"),
        (lambda folder: (folder / "settings.yaml").unlink(), "settings.yaml missing"),
        (lambda folder: (folder / "trials.csv").write_bytes(b"\xff\xfe\0"), "trials.csv: "),
        (lambda folder: (folder / "summary.json").write_text("[]"), "must be a mapping"),
        (lambda folder: (folder / "summary.json").write_text("{}"), "suite: must be a text"),
        (cut("summary.json", 0.5), "summary.json: is not valid JSON"),
        (cut("trials.csv", 0.5), "trials.csv"),
        (cut("trials.csv", 0.0), "trials.csv: lacks the columns"),
        (edit("trials.csv", ",recovered,", ",won,"), "lacks the columns recovered"),
        (edit("trials.csv", "False", "Maybe"), "does not parse"),
        (edit("trials.csv", ",zero,", ",one,"), "'one' is not in summary.json"),
        (edit("summary.json", '"zero": {', '"other": {'), "not those of settings.yaml"),
        (summary(trials=9), "has 8 trials"),
        (summary(recovered=99), "recovered: must be a whole number"),
        (summary(recovered_rate="all"), "recovered_rate: must be a number, not 'all'"),
        (edit("settings.yaml", "seed: 4", "seed: four"), "settings.yaml: seed"),
    ],
)
def test_a_folder_that_is_not_whole_is_refused(
    change: Callable[[Path], None], message: str, tmp_path: Path
) -> None:
    """Missing, cut off, foreign or contradicting files: one line that names the file."""
    folder = copied("random", tmp_path)
    change(folder)
    with pytest.raises(ConfigError) as caught:
        load_results(folder)
    assert message in str(caught.value) and str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_stopped_evaluation_is_told_apart(tmp_path: Path) -> None:
    """The text says how to finish it."""
    folder = copied("random", tmp_path)
    (folder / "summary.json").unlink()
    (folder / "trials.partial.jsonl").write_text("")
    with pytest.raises(ConfigError, match="the command that began it goes on"):
        load_results(folder)
    with pytest.raises(ConfigError, match="no such folder"):
        load_results(tmp_path / "nowhere")


def test_numbers_and_intervals_are_checked() -> None:
    """null is nothing; true, text, infinity and three ends are refused."""
    assert number({"a": 2}, "a", "file") == 2 and number({"a": None}, "a", "file") is None
    assert interval({"a": [1, 2.5]}, "a", "file") == (1, 2.5)
    assert interval({"a": [None, None]}, "a", "file") is None
    for wrong in (True, "1", math.inf, [1]):
        with pytest.raises(ConfigError, match="file: a: must be a number"):
            number({"a": wrong}, "a", "file")
    with pytest.raises(ConfigError, match="must be a number"):
        number({}, "a", "file", needed=True)
    for wrong in ([1], [1, 2, 3], 5):
        with pytest.raises(ConfigError, match=r"must be \[low, high\]"):
            interval({"a": wrong}, "a", "file")
