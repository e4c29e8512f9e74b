"""training/pictures/report/words.py: what the first sentence claims."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from poise.training.pictures.report.words import early_fall_notes, lead, trials_met


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


def met(**trials: list[str]) -> Any:
    """The results of controllers with these trials, of which those that begin with "early" are
    over before the push."""
    found = {name: [SimpleNamespace(met=(each,), fell_first=each.startswith("early"))
                    for each in own] for name, own in trials.items()}  # fmt: skip
    return SimpleNamespace(controllers=tuple(found), of=found.get, summary={"ranking": [*found]})


@pytest.mark.parametrize(("trials", "says"), [
    ({"a": ["1", "2"]}, "with 2 trials"),
    ({"a": ["1", "2"], "b": ["2", "1"]}, "on the same 2 trials"),
    ({"a": ["1", "2"], "b": ["1", "3"]}, "with 2 trials each, 1 of them common to all"),
    ({"a": ["1", "2"], "b": ["1"]}, "with 1 to 2 trials each, 1 of them common to all"),
])  # fmt: skip
def test_common_trials_are_counted(trials: dict[str, list[str]], says: str) -> None:
    """A second stage has other pushes for each controller."""
    assert trials_met(met(**trials)) == says


def test_falls_before_the_push_are_said() -> None:
    """Of those controllers that have any."""
    found = met(a=["1", "2"], b=["1", "early 2", "early 3"])
    assert early_fall_notes(found) == [
        "b fell before the push in 2 of 3 trials, which count as lost"
    ]
