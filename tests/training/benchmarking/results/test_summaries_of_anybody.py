"""Summaries whose entries are wrong, and all that reads them: one line each."""

from __future__ import annotations

import contextlib
import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from rich.console import Console

from poise.configs.errors import ConfigError, PoiseError
from poise.training.benchmarking.evaluation.folder import read_settings
from poise.training.benchmarking.evaluation.tables import print_summary
from poise.training.benchmarking.results.compare import compare, print_comparison
from poise.training.benchmarking.results.leaderboard import write_leaderboard
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.summary import read_summary
from poise.training.pictures.report.factors import indicators, seed_table
from poise.training.pictures.report.page import write_report
from poise.training.pictures.report.plots import step_lines
from tests.training.benchmarking.results.test_compare import NO, YES, write_result

WRONG = (None, True, "x", [], -1, 10**300, [1, None], {"x": 1})
GONE = object()


def places(value: Any, here: tuple = ()) -> Iterator[tuple]:
    """Paths of all entries of mappings and lists in each other."""
    inside = value.items() if isinstance(value, dict) else enumerate(value)
    for key, child in inside:
        yield (*here, key)
        if isinstance(child, (dict, list)):
            yield from places(child, (*here, key))


def changed(summary: dict, place: tuple, value: Any) -> dict:
    """The summary with another value in a place, or without it."""
    whole = parent = copy.deepcopy(summary)
    for key in place[:-1]:
        parent = parent[key]
    if value is GONE:
        del parent[place[-1]]
    else:
        parent[place[-1]] = value
    return whole


def test_wrong_entries_are_refused_in_one_line(tmp_path: Path) -> None:
    """Every entry of a summary, missing or of another kind: what is not refused when it is read
    can be compared, ranked and reported; anything but a PoiseError is raised here."""
    a = write_result(tmp_path / "a", {"pd": YES, "abe07": YES})
    b = write_result(tmp_path / "b", {"pd": YES, "abe07": NO}, abe07=15.0)
    path, page = b / "summary.json", tmp_path / "page.md"
    summary = json.loads(path.read_text())
    scores = {"iqm": 1.0, "iqm_ci95": [0.5, 1.5], "tasks": 1, "values": [1.0], "worst": 0.5,
              "worst_seed": 1}  # fmt: skip
    summary["seeds"] = [{"name": "pd", "members": ["pd"], "seeds": [1], "eta": scores}]
    curves = {"directions": [0.0, 90.0], "1": [1.0, 2.0], "2": [1.0, 2.0], "inf": [1.0, 2.0]}
    summary["step_limits"] = [{"controllers": ["pd"], "steps": {"speed": 1.0}, "curves": curves}]
    margin = {"direction": 0.0, "impulse": 9.0, "force": 90.0, "largest_tried": True}
    summary["controllers"]["pd"]["eurobench"] = {
        "body_sway_mean": 0.1, "recovery_time_mean": None, "recovery_time_trials": 0, "trials": 1,
        "margins": [margin],
    }  # fmt: skip
    rate = {"trials": 2, "recovered": 1, "recovered_rate": 0.5, "recovered_ci95": [0.1, 0.9]}
    more = {"stood": 1, "unpushed": 2, "j50_mean": 9.0, "j50_mean_ci95": [8.0, None]}
    for entry in summary["controllers"].values():
        entry["levels"] = [{"level": level, **rate, **more} for level in ("ideal", "field")]
    refused = accepted = 0
    for number, place in enumerate(places(summary)):
        if place[:2] == ("controllers", "abe07") and len(place) > 2:
            continue  # its entries are those of the other
        for value in (GONE, *WRONG[number % 3 :: 3]):  # neighbours of one kind share them
            path.write_text(json.dumps(changed(summary, place, value)))
            try:
                read_summary(path)
            except PoiseError as error:
                assert "\n" not in str(error) and str(path) in str(error)
                refused += 1
                continue
            accepted += 1
            for read in (
                lambda: print_comparison(compare(a, b), a, b, Console(quiet=True)),
                lambda: write_leaderboard([a, b], page),
                lambda: print_summary(read_summary(path), Console(quiet=True)),
                lambda: seed_table(load_results(b)),
                lambda: indicators(load_results(b), ["pd"]),
                lambda: step_lines(load_results(b)),
            ):
                with contextlib.suppress(PoiseError):
                    read()
    assert refused > 500 and accepted > 50


@pytest.mark.parametrize("text", ["a\nb", "\x1b]0;a\x07", "\u202ea", "x" * 5000])
def test_texts_that_act_are_refused(tmp_path: Path, text: str) -> None:
    """Wherever a text stands in a summary, names of controllers and of keys among them."""
    folder = write_result(tmp_path / "a", {"pd": YES})
    path, settings = folder / "summary.json", folder / "settings.yaml"
    summary = json.loads(path.read_text())
    texts = [place for place in places(summary) if isinstance(at(summary, place), str)]
    assert len(texts) > 5
    for place in texts:
        path.write_text(json.dumps(changed(summary, place, text)))
        with pytest.raises(ConfigError, match="summary.json: .*"):
            read_summary(path)
    path.write_text(json.dumps({**summary, text: 1}))
    with pytest.raises(ConfigError, match="summary.json: "):
        read_summary(path)
    path.write_text(json.dumps(summary))
    data = yaml.safe_load(settings.read_text())
    settings.write_text(yaml.safe_dump({**data, "controllers": {**data["controllers"], text: "1"}}))
    with pytest.raises(ConfigError, match="settings.yaml: controllers: "):
        read_settings(folder)


def at(value: Any, place: tuple) -> Any:
    """What stands in a place."""
    for key in place:
        value = value[key]
    return value


@pytest.mark.parametrize("key", ["trials", "recovered", "fallen", "evaluated"])
def test_a_report_counts_no_more_than_there_can_be(tmp_path: Path, key: str) -> None:
    """Statistics of larger numbers end in an error of their own."""
    folder = write_result(tmp_path / "a", {"pd": YES})
    path = folder / "summary.json"
    summary = json.loads(path.read_text())
    path.write_text(json.dumps(changed(summary, ("controllers", "pd", key), 10**300)))
    with pytest.raises(ConfigError, match=f"controllers.pd.{key}: must be at most"):
        write_report(folder, films=False)
