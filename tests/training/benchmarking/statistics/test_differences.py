"""training/benchmarking/statistics/differences.py, against published examples and statsmodels."""

from __future__ import annotations

import numpy as np
import pytest

from poise.training.benchmarking.statistics.differences import (
    difference,
    paired_rates,
    relative_gain,
)
from poise.training.benchmarking.statistics.rates import wilson_interval


def test_newcombes_published_examples() -> None:
    """Method 10, example (a) of [Newcombe98]: 56/70 − 48/80 = 0.2, interval 0.0524 to 0.3339."""
    gap, ends = difference(48 / 80, wilson_interval(48, 80), 56 / 70, wilson_interval(56, 70))
    assert gap == pytest.approx(0.2)
    assert ends == pytest.approx((0.0524, 0.3339), abs=5e-5)


@pytest.mark.parametrize(("a", "n", "b", "m"), [(9, 10, 3, 10), (0, 20, 0, 10), (5, 56, 0, 29)])
def test_independent_rates_are_those_of_statsmodels(a: int, n: int, b: int, m: int) -> None:
    """Newcombe's interval, also where a rate is 0 or 1."""
    statsmodels = pytest.importorskip("statsmodels.stats.proportion")
    low, high = statsmodels.confint_proportions_2indep(a, n, b, m, method="newcomb")
    _, ends = difference(b / m, wilson_interval(b, m), a / n, wilson_interval(a, n))
    assert ends == pytest.approx((low, high), abs=1e-6)


def test_newcombes_published_pairs() -> None:
    """Of 50 pairs 36 both, 12 and 2 one alone: 0.2, interval 0.0569 to 0.3404 [Newcombe98b]."""
    gap, ends = paired_rates(36, 2, 12, 0)
    assert gap == pytest.approx(0.2) and ends == pytest.approx((0.0569, 0.3404), abs=5e-5)


def test_pairs_without_correlation_are_like_independent_rates() -> None:
    """both · neither = only_a · only_b makes φ = 0; agreement makes the interval narrower."""
    gap, free = paired_rates(12, 18, 8, 12)
    alone = difference(0.6, wilson_interval(30, 50), 0.4, wilson_interval(20, 50))
    assert (gap, free) == (pytest.approx(alone[0]), pytest.approx(alone[1]))
    gap, close = paired_rates(20, 10, 0, 20)
    assert gap == pytest.approx(-0.2) and close.high - close.low < free.high - free.low


def test_the_paired_interval_holds_the_truth() -> None:
    """In 2000 simulated tables of 60 pairs, 93 to 97 % of the 95 % intervals hold the truth."""
    rng, shares = np.random.default_rng(0), np.array([0.45, 0.1, 0.2, 0.25])
    tables = rng.multinomial(60, shares, size=2000)
    ends = [paired_rates(*map(int, table))[1] for table in tables]
    assert 0.93 < np.mean([low <= 0.1 <= high for low, high in ends]) < 0.97


def test_equal_trials_have_no_difference() -> None:
    """Perfect agreement: φ = 1, and the interval is a fraction of that of strangers."""
    gap, close = paired_rates(7, 0, 0, 5)
    _, free = difference(7 / 12, wilson_interval(7, 12), 7 / 12, wilson_interval(7, 12))
    assert gap == 0.0 and close.low == pytest.approx(-close.high)
    assert 0.0 < close.high < 0.15 * free.high


@pytest.mark.parametrize("counts", [(0, 0, 0, 0), (1, -1, 0, 3)])
def test_counts_that_are_none(counts: tuple[int, int, int, int]) -> None:
    """No trial, or a negative count."""
    with pytest.raises(ValueError, match="must not be negative"):
        paired_rates(*counts)


def test_a_relative_gain_is_that_of_the_logarithms() -> None:
    """Twice as much is +100 %; exchanging the two inverts the interval; zero has no gain."""
    gain, ends = relative_gain(10.0, (8.0, 12.5), 20.0, (16.0, 25.0))
    reach = np.sqrt(2) * np.log(1.25)
    assert gain == pytest.approx(1.0) and ends is not None
    assert ends == pytest.approx((2 * np.exp(-reach) - 1, 2 * np.exp(reach) - 1))
    back, turned = relative_gain(20.0, (16.0, 25.0), 10.0, (8.0, 12.5))
    assert back == pytest.approx(-0.5) and turned is not None
    assert 1 + turned.low == pytest.approx(1 / (1 + ends.high))
    assert relative_gain(0.0, (0.0, 1.0), 1.0, (0.5, 2.0)) == (None, None)
