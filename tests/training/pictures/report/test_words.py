"""training/pictures/report/words.py: what the first sentence claims."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from poise.training.pictures.report.words import lead


def results(rates: dict[str, float], **pair: Any) -> Any:
    """The results of two controllers on 20 trials, and what their pair says."""
    entries = {name: {"recovered_rate": rate, "trials": 20, "never_fell_rate": rate}
               for name, rate in rates.items()}  # fmt: skip
    a, b = rates
    pairs = [{"a": b, "b": a, **pair}] if pair else []
    summary = {"ranking": [a, b], "controllers": entries, "rated": "random", "pairs": pairs}
    return SimpleNamespace(summary=summary, controllers=[a, b])


@pytest.mark.parametrize(
    ("pair", "place"),
    [
        ({"p_mcnemar": 1.0}, "a is listed first, not separated from b (McNemar p = 1.00)"),
        ({"p_mcnemar": 0.049}, "a comes first"),
        ({}, "a is listed first, not compared with b on the same trials"),
        (
            {"p_mcnemar": 0.01, "j50_gain_ci95": (-0.02, 0.1)},
            "a is listed first, not separated from b (gain in J50 -2.0 to +10.0 %)",
        ),
        ({"p_mcnemar": 1.0, "j50_gain_ci95": (0.01, 0.1)}, "a comes first"),
        ({"p_mcnemar": 1.0, "j50_gain_ci95": (-0.1, -0.01)}, "a comes first"),  # b against a
    ],
)
def test_a_controller_comes_first_where_the_trials_separate_it(pair: Any, place: str) -> None:
    """By the gain in J50 where there is one, else by McNemar's test."""
    said = lead(results({"a": 0.55, "b": 0.5}, **pair))
    assert said[0].startswith(f"{place}: it ") and "55.0% of 20 random trials" in said[0]


@pytest.mark.parametrize(("bound", "says"), [
    (None, "at 8.1 N·s (95 % 8.1 to 8.1)"), ("upper", "at no more than 8.1 N·s: 0.50"),
    ("lower", "at no less than 8.1 N·s: 0.50"),
])  # fmt: skip
def test_a_bound_is_no_estimate(bound: Any, says: str) -> None:
    """It has a word before it and no interval."""
    found = results({"a": 0.0, "b": 0.0}, p_mcnemar=1.0)
    for entry in found.summary["controllers"].values():
        entry |= {"j50_mean": 8.1, "j50_mean_ci95": (8.1, 8.1), "j50_mean_bound": bound,
                  "eta_mean": 0.5, "eta_min": 0.5}  # fmt: skip
    assert says in lead(found)[1]


def test_equal_results_share_the_first_place() -> None:
    """Whatever the pair says."""
    said = lead(results({"a": 0.5, "b": 0.5}, p_mcnemar=1.0))
    assert said[0].startswith("a ties with b for the first place: ")
