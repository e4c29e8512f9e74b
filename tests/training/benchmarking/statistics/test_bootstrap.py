"""Bootstrap intervals of J50, of its mean over directions and of paired gains."""

import time

import numpy as np
import pytest
from scipy.special import expit

from poise.training.benchmarking.statistics.bootstrap import (
    j50_gain,
    mean_over_directions,
)
from poise.training.benchmarking.statistics.differences import relative_gain
from poise.training.benchmarking.statistics.fits import fit_logistic

ANGLES = np.arange(4) * 90.0
TRUE_J50 = np.array([12.0, 16.0, 18.0, 16.0])


def direction_fit(impulse, recovered, **options):
    """The fit of one direction alone."""
    return mean_over_directions(np.zeros(len(impulse)), impulse, recovered, **options).fits[0]


def envelope(rng, n=30, gain=1.0, scale=1.0):
    """Trials of two controllers in four directions; the second one has J50 larger by `gain`.

    Both meet the same impulse with the same luck.
    """
    direction = np.repeat(ANGLES, n)
    j50 = np.repeat(TRUE_J50, n)
    impulse = j50 * rng.uniform(0.6, 1.6, j50.size)
    luck = rng.random(j50.size)
    reference = luck < expit((j50 - impulse) / scale)
    candidate = luck < expit((gain * j50 - impulse) / scale)
    return direction, impulse, reference, candidate


def test_interval_covers_the_true_j50():
    """Of 200 simulated directions with 30 trials, about 95 % have the truth in the interval."""
    rng = np.random.default_rng(0)
    held = 0
    for k in range(200):
        impulse = 17 * rng.uniform(0.7, 1.3, 30)
        recovered = rng.random(30) < expit(17 - impulse)
        low, high = direction_fit(impulse, recovered, resamples=300, seed=k).j50_ci
        held += low <= 17 <= high
    assert 0.88 <= held / 200 <= 0.985


def test_interval_of_the_mean_covers_the_true_mean():
    """Of 100 simulated envelopes about 95 % have the true mean J50 in the interval."""
    rng = np.random.default_rng(1)
    held = 0
    for k in range(100):
        direction, impulse, recovered, _ = envelope(rng)
        result = mean_over_directions(direction, impulse, recovered, resamples=200, seed=k)
        held += result.j50_mean_ci.low <= TRUE_J50.mean() <= result.j50_mean_ci.high
    assert 0.89 <= held / 100 <= 0.99


def test_interval_of_the_gain_covers_the_true_gain():
    """Of 60 simulated pairs about 95 % have the true relative gain in the interval."""
    rng = np.random.default_rng(2)
    held = 0
    for k in range(60):
        gain = j50_gain(*envelope(rng, gain=1.15), resamples=150, seed=k).mean
        held += gain.relative_ci.low <= 0.15 <= gain.relative_ci.high
    assert 0.88 <= held / 60 <= 0.99


def test_direction_fit_brackets_its_estimate():
    """The fit is `fit_logistic`'s, and lies in its interval, for J50 and for J90."""
    rng = np.random.default_rng(4)
    impulse = 17 * rng.uniform(0.7, 1.3, 40)
    recovered = rng.random(40) < expit(17 - impulse)
    result = direction_fit(impulse, recovered)
    assert result.fit == fit_logistic(impulse, recovered)
    assert result.j50_ci.low < result.fit.j50 < result.j50_ci.high
    assert result.j90_ci.low < result.fit.j90 < result.j90_ci.high


def test_mean_over_directions_is_the_mean_of_the_fits():
    """Each direction has its own fit, in rising order, and the same weight in the mean."""
    direction, impulse, recovered, _ = envelope(np.random.default_rng(6))
    mixed = np.random.default_rng(0).permutation(direction.size)[10:]
    result = mean_over_directions(direction[mixed], impulse[mixed], recovered[mixed])
    assert result.directions == (0.0, 90.0, 180.0, 270.0)
    for angle, fit in zip(result.directions, result.fits, strict=True):
        rows = mixed[direction[mixed] == angle]
        assert fit.fit == fit_logistic(impulse[rows], recovered[rows])
    assert result.j50_mean == pytest.approx(np.mean([f.fit.j50 for f in result.fits]))
    assert result.bounded == 0


def test_the_mean_is_known_better_than_its_parts():
    """Directions are resampled apart: four with the same trials have half the width of one."""
    _, impulse, recovered, _ = envelope(np.random.default_rng(7), n=60)
    trials = np.tile(impulse[:60], 4), np.tile(recovered[:60], 4)
    result = mean_over_directions(np.repeat(ANGLES, 60), *trials)
    gain = j50_gain(np.repeat(ANGLES, 60), *trials, np.tile(impulse[:60] < 13, 4))
    one = np.mean([np.ptp(f.j50_ci) for f in result.fits])
    assert np.ptp(result.j50_mean_ci) == pytest.approx(one / 2, rel=0.15)
    one = np.mean([np.ptp(g.relative_ci) for g in gain.gains])
    assert np.ptp(gain.mean.relative_ci) == pytest.approx(one / 2, rel=0.15)


def test_bounds_are_counted():
    """A direction without any loss is counted as a bound."""
    direction, impulse, recovered, _ = envelope(np.random.default_rng(8))
    recovered = recovered | (direction == 90)
    assert mean_over_directions(direction, impulse, recovered).bounded == 1


def test_a_controller_gains_nothing_over_itself():
    """The same outcomes give a gain of exactly zero, without any width: the pairing holds."""
    direction, impulse, recovered, _ = envelope(np.random.default_rng(9))
    gain = j50_gain(direction, impulse, recovered, recovered)
    for g in (gain.mean, *gain.gains):
        assert (g.relative, *g.relative_ci) == (0.0,) * 3


def test_gain_is_candidate_minus_reference():
    """The gain is positive if the candidate is better, and the inverse when they swap."""
    direction, impulse, reference, candidate = envelope(np.random.default_rng(10), gain=1.2)
    there = j50_gain(direction, impulse, reference, candidate)
    back = j50_gain(direction, impulse, candidate, reference)
    assert there.mean.relative_ci.low > 0
    inverse = -np.array(there.mean.relative_ci) / (1 + np.array(there.mean.relative_ci))
    np.testing.assert_allclose(back.mean.relative_ci, inverse[::-1], rtol=1e-3)
    assert there.mean.relative == pytest.approx(-back.mean.relative / (1 + back.mean.relative))


def test_gain_agrees_with_the_two_envelopes():
    """The gain of the mean is the ratio of the two mean J50, minus one."""
    direction, impulse, reference, candidate = envelope(np.random.default_rng(11), gain=1.15)
    a = mean_over_directions(direction, impulse, reference)
    b = mean_over_directions(direction, impulse, candidate)
    gain = j50_gain(direction, impulse, reference, candidate)
    assert gain.mean.relative == pytest.approx(b.j50_mean / a.j50_mean - 1)
    assert gain.directions == a.directions
    for g, fit_a, fit_b in zip(gain.gains, a.fits, b.fits, strict=True):
        assert g.relative == pytest.approx(fit_b.fit.j50 / fit_a.fit.j50 - 1)


def test_pairing_narrows_the_gain():
    """The paired interval is clearly narrower than with the candidate's trials reshuffled."""
    rng = np.random.default_rng(12)
    direction, impulse, reference, candidate = envelope(rng, n=60, gain=1.05, scale=2.0)
    paired = j50_gain(direction, impulse, reference, candidate).mean
    a = mean_over_directions(direction, impulse, reference)
    b = mean_over_directions(direction, impulse, candidate)
    _, unpaired = relative_gain(a.j50_mean, a.j50_mean_ci, b.j50_mean, b.j50_mean_ci)
    assert np.ptp(paired.relative_ci) < 0.7 * np.ptp(unpaired)


def test_relative_gain_over_nothing_is_not_a_number():
    """A reference whose J50 is zero has no relative gain."""
    impulse = np.arange(0.0, 10.0)
    gain = j50_gain(np.zeros(10), impulse, impulse < 0, impulse < 5).mean
    assert np.isnan(gain.relative)


def test_everything_repeats_from_its_seed():
    """The same seed gives the same figures, another seed other intervals of the same estimate."""
    trials = envelope(np.random.default_rng(13), gain=1.1)
    assert j50_gain(*trials, seed=3) == j50_gain(*trials, seed=3)
    a = mean_over_directions(*trials[:3], seed=3)
    b = mean_over_directions(*trials[:3], seed=4)
    assert a == mean_over_directions(*trials[:3], seed=3)
    assert a.j50_mean == b.j50_mean and a.j50_mean_ci != b.j50_mean_ci
    assert direction_fit(*trials[1:3], seed=3) == direction_fit(*trials[1:3], seed=3)


def test_a_thousand_replicates_of_sixteen_directions_take_seconds():
    """The batched solve is fast: well under five seconds for a whole envelope."""
    rng = np.random.default_rng(14)
    direction = np.repeat(np.arange(16) * 22.5, 40)
    impulse = rng.uniform(8, 26, direction.size)
    recovered = rng.random(direction.size) < expit(17 - impulse)
    start = time.perf_counter()
    mean_over_directions(direction, impulse, recovered, resamples=1000)
    assert time.perf_counter() - start < 5.0


def test_bad_input_is_refused():
    """Directions that do not fit the trials are errors."""
    with pytest.raises(ValueError, match="direction"):
        mean_over_directions([0.0], [1.0, 2.0], [1, 0])
    with pytest.raises(ValueError, match="direction"):
        mean_over_directions([0.0, np.nan], [1.0, 2.0], [1, 0])
    with pytest.raises(ValueError, match="shape"):
        j50_gain([0.0, 0.0], [1.0, 2.0], [1, 0], [1])
