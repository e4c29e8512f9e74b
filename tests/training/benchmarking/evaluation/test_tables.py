"""training/benchmarking/evaluation/tables.py: who comes first."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any, cast

import pytest
from rich.console import Console

from poise.training.benchmarking.evaluation.tables import (
    print_lost,
    print_summary,
    ranked,
    shared_ranks,
)
from poise.training.running.summary import Entry, Summary
from tests.support.weekly import daily

RESULTS = sorted((Path(__file__).parents[4] / "docs/results").rglob("*.json"))
EDGES = "│┃┓┐┩┘┛"


def entries(measure: str, values: dict[str, tuple[float, float]]) -> dict[str, Entry]:
    """Name → (result, external root force) as entries of a summary."""
    made: dict[str, Any] = {
        name: {measure: value, "recovered_rate": 0.5, "root_force_max": force}
        for name, (value, force) in values.items()
    }
    return made


@pytest.mark.parametrize("measure, step", [("j50_mean", 0.1), ("fraction50", 0.01)])
def test_results_that_print_alike_share_a_rank(measure: str, step: float) -> None:
    """The next rank is left out."""
    one = 2.0 + 0.2 * step
    some = entries(measure, {
        "a": (one, 0.0), "b": (2.0 + step, 0.0), "c": (2.0, 0.0), "d": (1.0, 0.4),
    })  # fmt: skip
    assert ranked(some) == ["b", "a", "c", "d"]
    assert shared_ranks(some) == {"b": 1, "a": 2, "c": 2, "d": 4}


def test_a_force_from_nowhere_has_no_rank() -> None:
    """It comes last, however much it recovers, and takes no place."""
    some = entries("j50_mean", {"cheat": (9.0, 2e5), "a": (2.0, 0.0), "b": (1.0, 0.0)})
    assert ranked(some) == ["a", "b", "cheat"]
    assert shared_ranks(some) == {"cheat": None, "a": 1, "b": 2}


def test_without_a_j50_the_rate_decides() -> None:
    """Also where only some have a J50."""
    some = entries("j50_mean", {"a": (9.0, 0.0), "b": (1.0, 0.0)})
    del some["a"]["j50_mean"]
    some["a"]["recovered_rate"], some["b"]["recovered_rate"] = 0.25, 0.75
    assert ranked(some) == ["b", "a"] and shared_ranks(some) == {"a": 2, "b": 1}


@pytest.mark.parametrize("width", daily([80, 120, 100], 2))
@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_tables_fold_and_are_not_cut(path: Path, width: int) -> None:
    """A console that is too narrow for them shows every cell, and the right edge."""
    text = io.StringIO()
    print_summary(json.loads(path.read_text()), Console(file=text, width=width))
    rows = [line for line in text.getvalue().splitlines() if line[0] in "│┃┏┡└"]
    assert rows and all(line[-1] in EDGES for line in rows)
    assert "…" not in text.getvalue()


def printed(summary: dict[str, Any], width: int = 120) -> str:
    """What `print_summary` prints."""
    text = io.StringIO()
    print_summary(cast(Summary, summary), Console(file=text, width=width))
    return text.getvalue()


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_no_word_of_the_ranking_is_broken(width: int) -> None:
    """What does not fit beside each other is in tables below each other, with one title."""
    summary = json.loads(RESULTS[0].read_text())
    text = printed({**summary, "pairs": []}, width)
    for word in ("worst", "recovered,", "one-step", "failures", "recoveries"):
        assert f" {word} " in text
    first = summary["controllers"][summary["ranking"][0]]
    assert f" {first['j50_min']:.1f} " in text and f" {first['eta_min']:.2f} " in text
    assert text.count(summary["suite"]) == 1


def test_the_words_of_a_table_are_explained_below_it() -> None:
    """Those that are there: of fractions of a limit, of p-values, of steps."""
    summary = json.loads(RESULTS[0].read_text())
    pairs = [pair["p_mcnemar"] for pair in summary["pairs"]]
    below = sum(p < 0.05 for p in pairs)
    assert 0 < below < len(pairs)
    text = printed(summary)
    line = f"McNemar p ≥ 0.05: these trials do not separate the two ({len(pairs) - below} of "
    assert line in text and "steps, mean: of all trials" in text
    assert f"of {len(pairs)} pairs; p is not corrected for their number)" in text
    one = printed({**summary, "pairs": summary["pairs"][:1]})
    assert "of 1 pairs)" in one and "fell before the push" not in one
    first = summary["ranking"][0]
    summary["controllers"][first]["fell_before_push"] = 3
    count = summary["controllers"][first]["evaluated"]
    told = f"{first} fell before the push in 3 of {count} trials, which count as lost"
    assert told in printed(summary, 200)
    assert "half of the pushes" not in text
    failures = sum(each["solver_failures_recovered"] for each in summary["controllers"].values())
    assert f"were falling; {failures} in trials that were recovered" in text
    for entry in summary["controllers"].values():
        entry.update(fraction50=0.8, fraction50_ci95=(0.7, 0.92), fraction50_bound=None)
        entry["steps_mean"] = 0.0
    summary["pairs"] = []
    text = printed(summary)
    assert "J50 [× ankle limit]: half of the pushes of this size are recovered, with the" in text
    assert "[0.70," in text  # the interval, which may be folded
    assert "McNemar" not in text and "steps, mean" not in text


def test_lost_trials_are_listed_with_the_command_that_shows_one() -> None:
    """Five of each controller that has lost any, whatever its name, and why; lines are not broken.
    A class of one's own is allowed there."""
    text = io.StringIO()
    lost = {"a": [], "my[own].py:B": [3, 17], "c": list(range(4, 12))}
    entries: dict[str, Any] = {name: {} for name in lost}
    entries["c"] = {
        "losses": [{"cause": "ankle_y at its torque limit, then no planned step", "trials": 8}]
    }
    print_lost(lost, entries, Path("out/x"), Console(file=text, width=40))
    assert text.getvalue().splitlines() == [
        "lost trials of my[own].py:B: 3, 17 (poise view out/x --trial 3 --controllers "
        "'my[own].py:B' --allow 'my[own].py:B')",
        "lost trials of c: 4, 5, 6, 7, 8, … (8) (poise view out/x --trial 4 --controllers c)",
        "  of 8 losses 8: ankle_y at its torque limit, then no planned step",
    ]
