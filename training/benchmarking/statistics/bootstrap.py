"""J50 per direction, its mean over directions and paired gains, with bootstrap intervals.

Trials are resampled within their direction (the stratum). Two controllers that met the same trials
are resampled together: a replicate that draws a trial draws it for both, so that what makes a trial
hard for both cancels in the gain.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .fits import Bound, LogisticFit, check_trials, fit_logistic, solve_weighted
from .rates import Interval, percentile_interval

PARAMETERS = 2  # of one logistic fit


@dataclass(frozen=True)
class DirectionFit:
    """Logistic fit of one direction, with intervals of J50 and J90."""

    fit: LogisticFit
    j50_ci: Interval
    j90_ci: Interval


@dataclass(frozen=True)
class EnvelopeFit:
    """Fits of all directions of one controller, and their mean J50.

    `bounded` counts the directions whose J50 is only a bound (see `LogisticFit.bound`): with any,
    the mean is one too.
    """

    directions: tuple[float, ...]
    fits: tuple[DirectionFit, ...]
    j50_mean: float
    j50_mean_ci: Interval
    bounded: int

    @property
    def mean_bound(self) -> Bound | None:
        """The kind of bound that J50 is in every direction; None where they differ, or none is."""
        kinds = {each.fit.bound for each in self.fits}
        return kinds.pop() if len(kinds) == 1 else None


@dataclass(frozen=True)
class RelativeGain:
    """J50 of a candidate over that of a reference, minus one; NaN where the latter is zero."""

    relative: float
    relative_ci: Interval


@dataclass(frozen=True)
class EnvelopeGain:
    """Gain of the mean J50 over directions, and the gain in each direction."""

    mean: RelativeGain
    directions: tuple[float, ...]
    gains: tuple[RelativeGain, ...]


def mean_over_directions(
    direction: ArrayLike,
    impulse: ArrayLike,
    recovered: ArrayLike,
    *,
    resamples: int = 1000,
    seed: int = 0,
) -> EnvelopeFit:
    """Fit every direction, and the mean of their J50 with a stratified bootstrap interval.

    Every direction has the same weight in the mean, however many trials it has. The percentile
    intervals are expanded for the number of trials (`percentile_interval`). In simulations the 95 %
    interval of J50 holds the truth in 90–94 % of cases at 20 to 30 trials and in 92–95 % at 60.
    That of J90 holds it in 78–92 % only: so few trials hardly show the scale.

    Args:
        direction: (n,) direction of each trial [°]. Equal values make one direction.
        impulse, recovered: (n,) trials, as for `fit_logistic`.

    Raises:
        ValueError: as `fit_logistic`, or a direction that is not finite.
    """
    impulse, recovered = check_trials(impulse, recovered)
    directions, rows = _strata(direction, impulse.size)
    seeds = np.random.SeedSequence(seed).spawn(len(rows))
    fits, replicates = [], []
    for i, s in zip(rows, seeds, strict=True):
        weights, freedom = _resample(i.size, resamples, s), (i.size, PARAMETERS)
        fit = fit_logistic(impulse[i], recovered[i])
        drawn = solve_weighted(impulse[i], recovered[i], weights)[:2]
        intervals = (percentile_interval(each, freedom) for each in drawn)
        fits.append(DirectionFit(fit, *intervals))
        replicates.append(drawn[0])
    return EnvelopeFit(
        directions=directions,
        fits=tuple(fits),
        j50_mean=float(np.mean([f.fit.j50 for f in fits])),
        j50_mean_ci=percentile_interval(
            np.mean(replicates, axis=0), (impulse.size, PARAMETERS * len(rows))
        ),
        bounded=sum(f.fit.bound is not None for f in fits),
    )


def j50_gain(
    direction: ArrayLike,
    impulse: ArrayLike,
    recovered_reference: ArrayLike,
    recovered_candidate: ArrayLike,
    *,
    resamples: int = 1000,
    seed: int = 0,
) -> EnvelopeGain:
    """Return the paired gain in J50 of a candidate over a reference that met the same trials.

        (J50_candidate − J50_reference) / J50_reference

    per direction, and for the mean J50 over directions (the ratio of the means, not the mean of the
    ratios). Each bootstrap replicate draws the same trials for both.

    Args:
        direction, impulse: (n,) trials, as for `mean_over_directions`.
        recovered_reference, recovered_candidate: (n,) outcomes of the same trials.

    Raises:
        ValueError: as `mean_over_directions`.
    """
    impulse, reference = check_trials(impulse, recovered_reference)
    impulse, candidate = check_trials(impulse, recovered_candidate)
    directions, rows = _strata(direction, impulse.size)
    seeds = np.random.SeedSequence(seed).spawn(len(rows))
    gains, j50s, replicates = [], [], []
    for i, s in zip(rows, seeds, strict=True):
        weights, outcomes = _resample(i.size, resamples, s), (reference[i], candidate[i])
        j50s.append([fit_logistic(impulse[i], outcome).j50 for outcome in outcomes])
        replicates.append([solve_weighted(impulse[i], each, weights)[0] for each in outcomes])
        gains.append(_gain(j50s[-1], replicates[-1], (i.size, PARAMETERS)))
    mean = _gain(
        np.mean(j50s, axis=0),
        np.mean(replicates, axis=0),
        (impulse.size, PARAMETERS * len(rows)),
    )
    return EnvelopeGain(mean, directions, tuple(gains))


def _gain(j50: ArrayLike, replicates: ArrayLike, freedom: tuple[int, int]) -> RelativeGain:
    """Return the gain from J50 of reference and candidate, (2,), and their replicates, (2,
    resamples)."""

    def relative(pair: ArrayLike) -> np.ndarray:
        one, two = np.asarray(pair)
        return np.divide(two - one, one, out=np.full_like(one, np.nan), where=one > 0)

    return RelativeGain(float(relative(j50)), percentile_interval(relative(replicates), freedom))


def _resample(trials: int, resamples: int, seed: np.random.SeedSequence) -> np.ndarray:
    """Return how often each trial is drawn in each bootstrap replicate, (resamples, trials)."""
    even = np.full(trials, 1 / trials)
    return np.random.default_rng(seed).multinomial(trials, even, size=resamples).astype(float)


def _strata(direction: ArrayLike, trials: int) -> tuple[tuple[float, ...], list[np.ndarray]]:
    """Return the distinct directions in rising order, and the row numbers of each."""
    angles = np.asarray(direction, dtype=float)
    if angles.shape != (trials,) or not np.all(np.isfinite(angles)):
        raise ValueError(f"direction must be finite, of shape ({trials},), got {angles.shape}")
    distinct = np.unique(angles)
    return tuple(distinct.tolist()), [np.flatnonzero(angles == d) for d in distinct]
