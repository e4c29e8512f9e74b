"""Rates, paired tests and aggregates against scipy, statsmodels and known answers."""

import json

import numpy as np
import pytest
from scipy import stats

from poise.training.benchmarking.statistics.rates import (
    eta,
    iqm,
    mcnemar,
    percentile_interval,
    poisson_interval,
    seed_aggregate,
    wilson_interval,
)


@pytest.mark.parametrize("successes, trials", [(0, 10), (1, 10), (7, 10), (10, 10), (431, 1000)])
def test_wilson_matches_scipy(successes, trials):
    """The Wilson interval is scipy's."""
    expected = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    ours = wilson_interval(successes, trials)
    np.testing.assert_allclose(ours, (expected.low, expected.high), atol=1e-12)


def test_wilson_matches_statsmodels():
    """The Wilson interval is statsmodels' proportion_confint."""
    proportion = pytest.importorskip("statsmodels.stats.proportion")
    for successes, trials in ((3, 20), (19, 20), (500, 1234)):
        expected = proportion.proportion_confint(successes, trials, 0.05, method="wilson")
        np.testing.assert_allclose(wilson_interval(successes, trials), expected, atol=1e-12)


def test_wilson_ends_stay_in_the_unit_interval():
    """No success starts the interval at exactly 0, all successes end it at exactly 1."""
    for trials in range(1, 200):
        assert wilson_interval(0, trials).low == 0.0
        assert wilson_interval(trials, trials).high == 1.0
    assert wilson_interval(0, 0) == (0.0, 1.0)


def test_wilson_covers_the_true_rate():
    """Over all outcomes of 40 trials the interval holds the true rate in about 95 % of them."""
    intervals = [wilson_interval(k, 40) for k in range(41)]
    rates = np.linspace(0.1, 0.9, 33)
    held = [
        sum(stats.binom.pmf(k, 40, p) for k, ci in enumerate(intervals) if ci.low <= p <= ci.high)
        for p in rates
    ]
    assert 0.94 < np.mean(held) < 0.97


def test_intervals_are_written_as_json_pairs():
    """An interval goes into summary.json as [low, high]."""
    assert json.loads(json.dumps(wilson_interval(0, 0))) == [0.0, 1.0]


@pytest.mark.parametrize("bad", [(5, 4), (-1, 4), (0, -1)])
def test_wilson_refuses_impossible_counts(bad):
    """More successes than trials, or a negative count, is an error."""
    with pytest.raises(ValueError, match="successes"):
        wilson_interval(*bad)


@pytest.mark.parametrize("counts", [(0, 0), (6, 17), (17, 6), (5, 5), (0, 8), (40, 75), (15, 140)])
def test_mcnemar_matches_the_binomial_test(counts):
    """The p-value is scipy's exact two-sided binomial test, for few and for many differences."""
    expected = stats.binomtest(counts[0], sum(counts), 0.5).pvalue if sum(counts) else 1.0
    assert mcnemar(*counts) == pytest.approx(expected, rel=1e-9)


def test_mcnemar_matches_statsmodels():
    """The p-value is statsmodels' exact McNemar test, whatever the trials that agree."""
    tables = pytest.importorskip("statsmodels.stats.contingency_tables")
    expected = tables.mcnemar([[100, 6], [17, 50]], exact=True).pvalue
    assert mcnemar(6, 17) == pytest.approx(expected, rel=1e-9)


def test_mcnemar_of_a_clear_winner_is_tiny_and_positive():
    """A thousand wins to one give a p-value near zero, not a rounding accident."""
    assert 0 < mcnemar(1, 1000) < 1e-200


def test_mcnemar_refuses_negative_counts():
    """A negative count is an error."""
    with pytest.raises(ValueError, match="negative"):
        mcnemar(-1, 3)


def test_iqm_ignores_the_outer_quarters():
    """Of eight scores the lowest two and the highest two do not count."""
    assert iqm([-1e6, 0, 1, 2, 3, 4, 100, 1e9]) == pytest.approx(2.5)
    assert iqm([[1.0, 2.0], [3.0, 100.0]]) == pytest.approx(2.5)
    assert iqm([1, 2, 6]) == pytest.approx(3.0)


def test_iqm_refuses_what_is_not_a_score():
    """NaN and an empty array are errors, not NaN results."""
    for bad in ([], [1.0, np.nan]):
        with pytest.raises(ValueError, match="finite"):
            iqm(bad)


def test_seed_aggregate_covers_the_true_mean():
    """With ten seeds the interval over seeds holds the true mean in about 95 % of simulations."""
    rng = np.random.default_rng(0)
    held = 0
    for k in range(200):
        scores = 5 + np.linspace(-1, 1, 4) + rng.normal(0, 1, size=(10, 4))
        _, ci = seed_aggregate(scores, resamples=300, seed=k)
        held += ci.low <= 5 <= ci.high
    assert 0.88 <= held / 200 <= 0.99


def test_seed_aggregate_resamples_within_each_task():
    """Tasks of different difficulty add no width: the bootstrap is stratified by task."""
    scores = np.tile([0.0, 10.0, 20.0, 30.0], (5, 1))
    assert seed_aggregate(scores) == (15.0, (15.0, 15.0))


def test_seed_aggregate_resamples_tasks_apart():
    """Each task draws its own seeds: errors of the seeds average out over tasks."""
    seeds = np.array([[-1.0], [0.0], [1.0]])
    _, one = seed_aggregate(seeds)
    _, many = seed_aggregate(np.tile(seeds, (1, 50)))
    assert np.ptp(many) < 0.5 * np.ptp(one)


def test_seed_aggregate_repeats_from_its_seed():
    """The same seed gives the same interval, another seed another one."""
    scores = np.random.default_rng(3).normal(size=(5, 3))
    assert seed_aggregate(scores, seed=1) == seed_aggregate(scores, seed=1)
    assert seed_aggregate(scores, seed=1) != seed_aggregate(scores, seed=2)


def test_expanded_percentiles_match_the_t_interval():
    """For replicates of a mean, the expanded interval is Student's t interval."""
    rng = np.random.default_rng(0)
    sample = rng.normal(size=12)
    error = stats.sem(sample) * np.sqrt(11 / 12)  # a bootstrap of 12 shows this much of it
    means = rng.normal(sample.mean(), error, size=1_000_000)
    expected = stats.t.interval(0.95, 11, sample.mean(), stats.sem(sample))
    np.testing.assert_allclose(percentile_interval(means, freedom=(12, 1)), expected, atol=0.005)
    plain = stats.norm.interval(0.95, sample.mean(), error)
    np.testing.assert_allclose(percentile_interval(means), plain, atol=0.005)


def test_eta_is_the_share_of_the_ankle_limit():
    """η of an impulse that equals mass times limit is 1, and shapes broadcast."""
    np.testing.assert_allclose(eta([12.27, 16.36], 40.9, [0.3, 0.4]), [1.0, 1.0])
    assert eta(20.45, 40.9, 1.0) == pytest.approx(0.5)


@pytest.mark.parametrize("mass, limit", [(0.0, 0.4), (40.9, [0.4, 0.0]), (40.9, np.nan)])
def test_eta_refuses_a_limit_or_mass_of_nothing(mass, limit):
    """Mass and limits must be positive."""
    with pytest.raises(ValueError, match="positive"):
        eta(16.0, mass, limit)


@pytest.mark.parametrize("count", [0, 1, 7, 120])
def test_poisson_matches_its_definition(count):
    """At the ends of the interval, so many or more, and so many or fewer, have 2.5 % each."""
    low, high = poisson_interval(count)
    assert stats.poisson.cdf(count, high) == pytest.approx(0.025)
    assert low == 0.0 if count == 0 else stats.poisson.sf(count - 1, low) == pytest.approx(0.025)


def test_poisson_refuses_a_negative_count():
    with pytest.raises(ValueError, match="count must not be negative"):
        poisson_interval(-1)
