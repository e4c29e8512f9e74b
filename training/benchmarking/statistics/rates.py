"""Statistics of recovered and lost trials: rates, paired tests, aggregates over training seeds.

Every function takes NumPy arrays (or what `np.asarray` takes), keeps no state, and where it draws
random numbers draws them from a seed, so that the same trials give the same figures.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypedDict

import numpy as np
import scipy  # loads its parts lazily
from numpy.typing import ArrayLike

CONFIDENCE = 0.95  # of every interval


class Interval(NamedTuple):
    """A 95 % confidence interval; a tuple, so that JSON writes it as [low, high]."""

    low: float
    high: float


class SeedFigures(TypedDict):
    """A figure over training seeds, `tasks` of each; `worst` is that of `worst_seed`."""

    iqm: float
    iqm_ci95: tuple[float | None, float | None]
    tasks: int
    values: list[float]
    worst: float
    worst_seed: int


def poisson_interval(count: int) -> Interval:
    """Return Garwood's exact interval of the mean of a Poisson distribution that gave `count`.

        (χ²_{α/2}(2 count) / 2, χ²_{1−α/2}(2 count + 2) / 2),   α = 0.05

    Divided by the time in which so many were counted, it is that of their rate.

    Raises:
        ValueError: a negative count.
    """
    if count < 0:
        raise ValueError(f"count must not be negative, got {count}")
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = 0.0 if count == 0 else 0.5 * float(scipy.stats.chi2.ppf(tail, 2 * count))
    return Interval(low, 0.5 * float(scipy.stats.chi2.ppf(1.0 - tail, 2 * count + 2)))


def wilson_interval(successes: int, trials: int) -> Interval:
    """Return the Wilson score interval of a proportion.

        (p̂ + z²/2n ± z √(p̂(1 − p̂)/n + z²/4n²)) / (1 + z²/n),   p̂ = successes / trials

    Unlike p̂ ± z·σ it stays inside [0, 1] and has a width at 0 and at n successes. No trial at all
    gives (0, 1).

    Raises:
        ValueError: not 0 <= successes <= trials.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"successes must be within [0, trials], got {successes} of {trials}")
    if trials == 0:
        return Interval(0.0, 1.0)
    z = float(scipy.stats.norm.ppf(0.5 + CONFIDENCE / 2))
    rate = successes / trials
    shrink = 1 + z**2 / trials
    centre = (rate + z**2 / (2 * trials)) / shrink
    half = z / shrink * np.sqrt(rate * (1 - rate) / trials + z**2 / (4 * trials**2))
    # At 0 and at n the exact end is 0 or 1; rounding may leave it a little outside.
    low = 0.0 if successes == 0 else float(centre - half)
    high = 1.0 if successes == trials else float(centre + half)
    return Interval(low, high)


def mcnemar(only_a: int, only_b: int) -> float:
    """Return the p-value of McNemar's test: do two controllers recover equally often on the same
    trials?

    Only the trials count on which they differ: `only_a` recovered by a alone, `only_b` by b alone.
    If both are equally good, only_a is Binomial(only_a + only_b, ½). The p-value is the exact
    two-sided binomial one, p = min(1, 2 P(X <= min(only_a, only_b))), at every count: no normal
    approximation with a threshold is needed.

    Raises:
        ValueError: a negative count.
    """
    if only_a < 0 or only_b < 0:
        raise ValueError(f"counts must not be negative, got {only_a} and {only_b}")
    tail = float(scipy.stats.binom.cdf(min(only_a, only_b), only_a + only_b, 0.5))
    return min(1.0, 2 * tail)


def iqm(scores: ArrayLike) -> float:
    """Return the interquartile mean [Agarwal21]: mean of the middle half of all scores, whatever
    the shape.

    The lowest and the highest ⌊n/4⌋ scores are dropped, so below four scores it is the mean.

    Raises:
        ValueError: no score, or one that is not finite.
    """
    return float(scipy.stats.trim_mean(_finite(scores), 0.25, axis=None))


def seed_aggregate(
    scores: ArrayLike, *, resamples: int = 2000, seed: int = 0
) -> tuple[float, Interval]:
    """Return the IQM of scores over training seeds, with a stratified percentile bootstrap
    [Agarwal21].

    Args:
        scores: (seeds, tasks) one score per training seed and task (direction, suite, …), or
            (seeds,) for a single task.
        resamples: number of bootstrap replicates. Each draws the seeds with replacement, apart for
            every task (the strata), and takes the IQM of what it drew.

    Raises:
        ValueError: no score, one that is not finite, or more than two axes.
    """
    table = _finite(scores)
    if table.ndim > 2:
        raise ValueError(f"scores must have shape (seeds,) or (seeds, tasks), got {table.shape}")
    table = table.reshape(len(table), -1)
    seeds, tasks = table.shape
    rows = np.random.default_rng(seed).integers(seeds, size=(resamples, seeds, tasks))
    drawn = np.take_along_axis(table[None], rows, axis=1)
    replicates = scipy.stats.trim_mean(drawn.reshape(resamples, -1), 0.25, axis=1)
    return iqm(table), percentile_interval(replicates)


def seed_figures(scores: np.ndarray, seeds: Sequence[int]) -> SeedFigures:
    """Return the IQM of (seeds, tasks) with its interval, every seed's mean, and the worst of
    these."""
    mean, interval = seed_aggregate(scores)
    values = scores.mean(axis=1)
    worst = int(np.argmin(values))
    return {
        "iqm": mean,
        "iqm_ci95": interval,
        "tasks": scores.shape[1],
        "values": values.tolist(),
        "worst": float(values[worst]),
        "worst_seed": seeds[worst],
    }


def percentile_interval(replicates: np.ndarray, freedom: tuple[int, int] | None = None) -> Interval:
    """Return the percentile bootstrap interval of replicates, shape (resamples,).

    Resampling n trials for an estimate with k parameters shows too little spread, by a factor of
    about √((n − k)/n). With `freedom` = (n, k) the percentiles are moved outwards for it and for
    the small sample, as a t interval is wider than a normal one ("expanded percentile interval",
    Hesterberg 2015): the tail is Φ(−√(n/(n − k)) t) with t of n − k degrees of freedom.
    """
    tail = (1 - CONFIDENCE) / 2
    if freedom is not None:
        n, k = freedom
        left = max(n - k, 1)
        tail = scipy.stats.norm.cdf(np.sqrt(n / left) * scipy.stats.t.ppf(tail, left))
    low, high = np.percentile(replicates, [100 * tail, 100 * (1 - tail)])
    return Interval(float(low), float(high))


def eta(j50: ArrayLike, mass: float, limit: ArrayLike) -> np.ndarray:
    """Return η = (J50 / m) / limit, J50 relative to the ankle limit.

    Args:
        j50: impulse recovered half the time [N·s], any shape.
        mass: of the robot [kg].
        limit: ankle limit per mass, ω δ · ωT / (1 − e^(−ωT)) [N·s/kg], of a
            shape that broadcasts with j50.

    Raises:
        ValueError: mass or a limit is not positive.
    """
    limit = np.asarray(limit, dtype=float)
    if not mass > 0 or not np.all(limit > 0):
        raise ValueError("mass and limit must be positive")
    return np.asarray(j50, dtype=float) / mass / limit


def _finite(scores: ArrayLike) -> np.ndarray:
    table = np.atleast_1d(np.asarray(scores, dtype=float))
    if table.size == 0 or not np.all(np.isfinite(table)):
        raise ValueError("scores must be finite and at least one")
    return table


def mean_or_none(values: Sequence[float | None]) -> float | None:
    """Return the mean of the values other than None, or None without any."""
    found = [value for value in values if value is not None]
    return float(np.mean(found)) if found else None
