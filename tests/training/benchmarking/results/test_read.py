"""training/benchmarking/results/read.py and training/running/summary.py."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from poise.configs.errors import ConfigError, PoiseWarning
from poise.training.benchmarking.diagnosis.diagnosis import COLUMNS as DIAGNOSIS
from poise.training.benchmarking.evaluation.folder import read_outcomes
from poise.training.benchmarking.results.leaderboard import leaderboard
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.summary import read_summary
from poise.training.benchmarking.trials.trial import FORMER
from poise.training.running.summary import both_ends
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


def test_what_was_lost_says_why_and_older_results_say_nothing(tmp_path: Path) -> None:
    """Every lost trial; the causes are counted in the summary."""
    results = load_results(finished("random"))
    for record in results.records:
        assert bool(record.why) is not record.recovered
    for name, entry in results.summary["controllers"].items():
        lost = sum(not record.recovered for record in results.of(name))
        assert sum(loss["trials"] for loss in entry.get("losses", [])) == lost
    old = copied("random", tmp_path)
    with (old / "trials.csv").open(newline="") as file:
        rows = [
            {k: v for k, v in row.items() if k not in DIAGNOSIS} for row in csv.DictReader(file)
        ]
    with (old / "trials.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    assert {record.why for record in load_results(old).records} == {""}


NOW = {new: old for old, new in FORMER.items()}


def in_older_names(folder: Path) -> None:
    """The files as the release before wrote them."""
    for path in (folder / "trials.csv", folder / "trials.jsonl"):
        text = re.sub("|".join(NOW), lambda match: NOW[match[0]], path.read_text())
        path.write_text(text)
    path = folder / "summary.json"
    path.write_text(path.read_text().replace('"evaluated":', '"played":'))


def test_older_names_are_read_for_one_release(tmp_path: Path) -> None:
    """A line for each file; results, and trials that are kept, are those of today."""
    old = copied("random", tmp_path)
    in_older_names(old)
    assert "full_motor" in (old / "trials.csv").read_text()
    with pytest.warns(PoiseWarning, match="older names") as caught:
        found = load_results(old)
    assert sorted(Path(str(each.message).partition(":")[0]).name for each in caught) == [
        "summary.json", "trials.csv",
    ]  # fmt: skip
    now = load_results(finished("random"))
    assert (found.summary, len(found.records)) == (now.summary, len(now.records))
    assert [each.line for each in found.records] == [each.line for each in now.records]
    assert "saturated_motor" in found.records[0].line and "randomised" in found.records[0].line
    with pytest.warns(PoiseWarning, match="trials.jsonl: .*'full_motor' is now 'saturated_motor'"):
        assert read_outcomes(old) == read_outcomes(finished("random"))


def test_a_loss_of_another_name_is_told_as_it_is(tmp_path: Path) -> None:
    """A name from a file is no format: its braces are text."""
    folder = copied("random", tmp_path)
    cells(loss="{0} {body.__class__}")(folder)
    assert all(r.why.startswith("{0} {body.__class__}") for r in load_results(folder).records)


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


def reversed_ranking(folder: Path) -> None:
    """Turns the ranking around."""
    data = json.loads((folder / "summary.json").read_text())
    data["ranking"].reverse()
    (folder / "summary.json").write_text(json.dumps(data))


def cells(**texts: str) -> Callable[[Path], None]:
    """Changes columns of trials.csv, in every line."""

    def change(folder: Path) -> None:
        with (folder / "trials.csv").open(newline="") as file:
            rows = [row | texts for row in csv.DictReader(file)]
        with (folder / "trials.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda folder: (folder / "summary.json").unlink(), "summary.json missing"),
        (lambda folder: (folder / "trials.csv").unlink(), "trials.csv missing"),
        (lambda folder: (folder / "settings.yaml").unlink(), "settings.yaml missing"),
        (lambda folder: (folder / "trials.csv").write_bytes(b"\xff\xfe\0"), "trials.csv: "),
        (lambda folder: (folder / "summary.json").write_text("[]"), "must be a mapping"),
        (lambda folder: (folder / "summary.json").write_text("{}"), "is of an older Poise"),
        (cut("summary.json", 0.5), "summary.json: is not valid JSON"),
        (cut("trials.csv", 0.5), "trials.csv"),
        (cut("trials.csv", 0.0), "trials.csv: lacks the columns"),
        (edit("trials.csv", ",recovered,", ",won,"), "lacks the columns recovered"),
        (edit("trials.csv", "False", "Maybe"), "does not parse"),
        (
            cells(saturated_from="zero"),
            "line 2 does not parse: could not convert string to float: 'zero'",
        ),
        (cells(capture_left="0.2", capture_outside=""), "capture_left without capture_outside"),
        (cells(start="inf"), "start: must be finite"),
        (cells(seed="one"), "line 2 does not parse"),
        (edit("trials.csv", ",zero,", ",one,"), "'one' is not in summary.json"),
        (edit("summary.json", '"zero": {', '"other": {'), "ranking: must name all controllers"),
        (edit("settings.yaml", "zero: ", "one: "), "not those of settings.yaml"),
        (summary(evaluated=9), "has 8 trials"),
        (summary(recovered=99), "recovered: must be a whole number"),
        (summary(recovered_rate="all"), "recovered_rate: must be a number, not 'all'"),
        (summary(trials=0), "trials: must be at least 1"),
        (summary(recovered_ci95=[1]), "recovered_ci95: must be a list of 2"),
        (summary(sectors="all"), "sectors: must be a list"),
        (summary(sectors=[{"direction": "north"}]), "sectors[0]"),
        (summary(directions=[]), "j50_mean: is missing"),
        (edit("summary.json", '"format": 2', '"format": 3'), "is of format 3, this one reads"),
        (edit("settings.yaml", "format: 2", "benchmark: 1"), "is of an older Poise"),
        (edit("summary.json", '"reference": "', '"reference": "other '), "no such controller"),
        (edit("settings.yaml", "seed: 4", "seed: four"), "settings.yaml: seed"),
        (edit("settings.yaml", "seed: 4", "seed: 5"), "seed: is 4, but settings.yaml has 5"),
        (summary(recovered_rate=0.99), "recovered_rate: must be recovered over trials, not 0.99"),
        (summary(recovered_ci95=[2, 3]), "recovered_ci95: must be from 0 to 1, not [2, 3]"),
        (summary(j50_mean_ci95=[61, 2]), "j50_mean_ci95: must have its lower end first"),
        (summary(fraction50=-5), "fraction50: must be 0 or more, not -5"),
        (summary(recovered=1, recovered_rate=1 / 8), "recovered: is 1, but trials.csv has"),
        (summary(trials=80, recovered=0, recovered_rate=0), "trials: is 80, but trials.csv has 8"),
        (summary(never_fell_rate=0.99), "never_fell_rate: is 0.99, but trials.csv has"),
        (edit("summary.json", '"p_mcnemar": ', '"p_mcnemar": -'), "p_mcnemar: must be from 0 to 1"),
        (reversed_ranking, "ranking: must name the best controller first"),
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
    with pytest.raises(ConfigError, match="summary.json missing; run the command that began it"):
        load_results(folder)
    with pytest.raises(ConfigError, match="no such folder"):
        load_results(tmp_path / "nowhere")


def test_intervals_may_be_open() -> None:
    """An end that is null is nothing to compute with."""
    assert both_ends((1.0, 2.5)) == (1.0, 2.5)
    assert both_ends((None, 2.5)) is None and both_ends(None) is None


@pytest.mark.parametrize(
    "page",
    ["leaderboard", *(f"leaderboard-{r}" for r in ("unitree_g1", "unitree_h1", "booster_t1"))],
)
def test_the_committed_results_are_read(page: str) -> None:
    """Those of the leaderboards have the form of today, and the pages are made of them."""
    root = Path(__file__).parents[4]
    text = (root / f"docs/{page}.md").read_text()
    (told,) = re.findall("<!-- Written by `poise leaderboard ([^`]+)`", text)
    sources = [word for word in told.split(" --page ")[0].split() if word.endswith(".json")]
    found = {source: read_summary(root / source) for source in sources}
    assert leaderboard(found) == text and found
    for source, summary in found.items():
        assert summary == json.loads((root / source).read_text(), object_hook=_as_read)
        assert summary["rated"] == "mix" and summary["reference"] in summary["controllers"]


def _as_read(mapping: dict[str, Any]) -> dict[str, Any]:
    """Intervals as pairs."""
    pairs = {key: tuple(value) for key, value in mapping.items() if key.endswith("ci95") and value}
    if "ankle_limit" in mapping and isinstance(mapping["ankle_limit"], list):
        pairs["ankle_limit"] = [tuple(row) for row in mapping["ankle_limit"]]
    return mapping | pairs
