"""`poise compare` and `poise leaderboard` on summaries whose entries are wrong: one line each."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from poise.configs.errors import PoiseError
from poise.training.results.compare import compare, print_comparison
from poise.training.results.leaderboard import write_leaderboard
from tests.training.results.test_benchmark import NO, YES, rate, write_result

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


def refused(summary: dict, path: Path, call: Callable[[], Any]) -> int:
    """How many changes of the summary are refused; anything but a PoiseError is raised."""
    count = 0
    for place in places(summary):
        for value in (GONE, *WRONG):
            path.write_text(json.dumps(changed(summary, place, value)))
            try:
                call()
            except PoiseError:
                count += 1
    return count


@pytest.mark.parametrize("benchmark", [True, False], ids=["benchmark", "evaluation"])
def test_wrong_entries_are_refused_in_one_line(tmp_path: Path, benchmark: bool) -> None:
    """Every entry of a summary, missing or of another kind, in comparisons and leaderboards."""
    a = write_result(tmp_path / "a", {"pd": YES, "abe07": YES})
    b = write_result(tmp_path / "b", {"pd": YES, "abe07": NO}, abe07=15.0)
    path = b / "summary.json"
    summary = json.loads(path.read_text())
    scores = {"iqm": 1.0, "iqm_ci95": [0.5, 1.5], "worst": 0.5, "worst_seed": 1}
    summary["seeds"] = [{"name": "pd", "members": ["pd"], "eta": scores}]
    if not benchmark:
        for folder in (a, b):
            data = json.loads((folder / "summary.json").read_text())
            del data["benchmark"]
            data["controllers"] = {name: rate(2, 4) for name in data["controllers"]}
            (folder / "summary.json").write_text(json.dumps(data))
        summary = json.loads(path.read_text())
    assert (
        refused(summary, path, lambda: print_comparison(compare(a, b), a, b, Console(quiet=True)))
        > 50
    )
    if benchmark:
        page = tmp_path / "page.md"
        assert refused(summary, path, lambda: write_leaderboard([a, b], page)) > 150
