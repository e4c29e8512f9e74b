"""Logistic fit of recovery against impulse: J50 and J90 from single trials.

Recovery is not monotone in the impulse near the limit, so J50 is a fit over many trials and not a
bisection. All bootstrap replicates of a fit are solved together, as rows of one array.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit

# Where the weak prior puts the scale s of the logistic curve, as a fraction of the mean impulse.
PRIOR_SCALE = 0.05
LOG_9 = float(np.log(9.0))  # logit of 0.9
MAX_ITERATIONS = 60
RIDGE = 1e-9  # of the curvature of a trial's weight
TOLERANCE = 1e-10  # of the Newton decrement, in units of log-likelihood

Bound = Literal["lower", "upper"]


@dataclass(frozen=True)
class LogisticFit:
    """Falling logistic curve P(recover | J) = 1 / (1 + exp((J − J50) / s))."""

    j50: float  #: impulse recovered with 50 % probability, in the unit of the trials
    j90: float  #: the same with 90 %, J50 − s ln 9: smaller than j50
    scale: float  #: s > 0, in the unit of the trials
    #: None, or the kind of bound. "lower": all trials were recovered, or the curve passes
    #: one half beyond the largest impulse tried, so that j50 is that largest impulse and the true
    #: J50 is at least about this. "upper": the same at the smallest impulse
    bound: Bound | None
    trials: int  #: their number
    recovered: int  #: how many of them were recovered

    def probability(self, impulse: ArrayLike) -> np.ndarray:
        """P(recover | J) at the given impulses, same shape. Of no use where `bound` is set."""
        return expit((self.j50 - np.asarray(impulse, dtype=float)) / self.scale)


def fit_logistic(impulse: ArrayLike, recovered: ArrayLike) -> LogisticFit:
    """Fit the falling logistic curve by penalised maximum likelihood.

        max over J50, s   Σ log P(outcome_i | J_i) − (s₀/s + log(s/s₀)),   s₀ = 0.05 · mean J

    The penalty is a weak prior on log s (mode log s₀, standard deviation about 1, an inverse gamma
    density of s). It keeps s finite for perfectly separated trials, whose J50 then lies between the
    last success and the first failure, and s > 0 for trials that do not fall with the impulse. With
    many trials it vanishes against the likelihood. J50 is never reported outside the impulses that
    were tried: see `LogisticFit.bound`. J90 follows the curve below them, down to zero.

    Args:
        impulse: (n,) impulses [N·s], or in N·s/kg, or as a fraction of a limit. Not negative.
        recovered: (n,) true or 1 where the trial was recovered.

    Raises:
        ValueError: no trials, shapes that differ, an impulse that is negative or not finite, an
            outcome other than 0 or 1.
    """
    impulse, recovered = check_trials(impulse, recovered)
    j50, j90, scale, side = solve_weighted(impulse, recovered, np.ones((1, impulse.size)))
    bound: dict[int, Bound | None] = {0: None, 1: "lower", -1: "upper"}
    return LogisticFit(
        j50=float(j50[0]),
        j90=float(j90[0]),
        scale=float(scale[0]),
        bound=bound[int(side[0])],
        trials=impulse.size,
        recovered=int(recovered.sum()),
    )


def solve_weighted(
    impulse: np.ndarray, recovered: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Solve `fit_logistic` for many weightings of the same checked trials at once.

    Args:
        impulse, recovered: (n,) trials, as `check_trials` returns them.
        weights: (replicates, n) how often each trial counts.

    Returns:
        j50, j90, scale, side: (replicates,) each; side is 1 where j50 is a lower bound, −1 where
        it is an upper bound, 0 otherwise.
    """
    centre = impulse.mean()
    unit = PRIOR_SCALE * centre if centre > 0 else 1.0
    x = (impulse - centre) / unit
    won, lost = weights * recovered > 0, weights * ~recovered > 0
    mixed = won.any(axis=1) & lost.any(axis=1)

    a, b = np.zeros(len(weights)), np.ones(len(weights))
    if mixed.any():
        a[mixed], b[mixed] = _newton(x, recovered, weights[mixed])
    middle = a / b
    # Trials that are separated leave J50 free in the gap; the prior must not move it out of there.
    last_won = np.where(won, x, -np.inf).max(axis=1)
    first_lost = np.where(lost, x, np.inf).min(axis=1)
    gap = mixed & (last_won < first_lost)
    middle[gap] = np.clip(middle[gap], last_won[gap], first_lost[gap])

    all_won, none_won = ~lost.any(axis=1), ~won.any(axis=1)
    above = all_won | (mixed & (middle > x.max()))
    below = none_won | (mixed & (middle < x.min()))
    middle[above], middle[below] = x.max(), x.min()
    # All recovered says as much of J90 as of J50, and so does none recovered.
    j90 = np.where(mixed, middle - LOG_9 / b, middle)
    side = above.astype(int) - below.astype(int)
    return centre + unit * middle, np.maximum(centre + unit * j90, 0.0), unit / b, side


def _newton(
    x: np.ndarray, recovered: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Maximise Σ wᵢ log P(yᵢ | xᵢ) + log b − b with P(recover | x) = σ(a − b x), b > 0.

    The objective is strictly concave in (a, b) as soon as a success and a failure have a weight, so
    Newton steps that are halved until the objective rises reach its only maximum.
    """
    sign = np.where(recovered, 1.0, -1.0)

    def objective(a: np.ndarray, b: np.ndarray, w: np.ndarray) -> np.ndarray:
        margin = sign * (a[:, None] - b[:, None] * x)
        return -(w * np.logaddexp(0.0, -margin)).sum(axis=1) + np.log(b) - b

    a, b = np.zeros(len(weights)), np.ones(len(weights))
    value = objective(a, b, weights)
    active = np.arange(len(weights))
    for _ in range(MAX_ITERATIONS):
        ai, bi, w = a[active], b[active], weights[active]
        p = expit(ai[:, None] - bi[:, None] * x)
        residual, curvature = w * (recovered - p), w * p * (1 - p)
        g_a = residual.sum(axis=1)
        g_b = -(residual @ x) + 1 / bi - 1
        # Eliminated around the curvature's centre: the determinant of the plain form cancels where
        # few trials bend the curve. What is added is for curves that are saturated everywhere.
        added = RIDGE * w.sum(axis=1)
        h_aa = curvature.sum(axis=1) + added
        at = curvature @ x / h_aa
        h_bb = (curvature * (x - at[:, None]) ** 2).sum(axis=1) + added * at**2 + 1 / bi**2
        step_b = (g_b + at * g_a) / h_bb
        step_a = g_a / h_aa + at * step_b
        decrement = g_a * step_a + g_b * step_b

        length = np.minimum(1.0, 0.9 * bi / np.maximum(-step_b, 1e-300))  # keeps b > 0
        for _ in range(MAX_ITERATIONS):
            new_a, new_b = ai + length * step_a, bi + length * step_b
            new = objective(new_a, new_b, w)
            worse = ~(new >= value[active] + 1e-4 * length * decrement - TOLERANCE)
            if not worse.any():
                break
            length[worse] /= 2
        a[active], b[active], value[active] = new_a, new_b, new
        active = active[decrement > TOLERANCE]
        if active.size == 0:
            break
    return a, b


def check_trials(impulse: ArrayLike, recovered: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the trials as float and bool arrays of shape (n,); raise ValueError as
    `fit_logistic`."""
    impulse = np.asarray(impulse, dtype=float)
    outcome = np.asarray(recovered)
    if impulse.ndim != 1 or impulse.shape != outcome.shape or impulse.size == 0:
        raise ValueError(
            "impulse and recovered must have one shape (n,) with n >= 1, "
            f"got {impulse.shape} and {outcome.shape}"
        )
    if not np.all(np.isfinite(impulse)) or np.any(impulse < 0):
        raise ValueError("impulses must be finite and not negative")
    if not np.all((outcome == 0) | (outcome == 1)):
        raise ValueError("recovered must be 0 or 1 (false or true)")
    return impulse, outcome.astype(bool)


def trial_bins(
    impulse: np.ndarray, recovered: np.ndarray, bins: int
) -> list[tuple[float, int, int]]:
    """(mean impulse, trials not recovered, trials) of bins with about equally many trials each.

    With at most as many distinct impulses as bins, each of them is a bin. In rising order.
    """
    levels = np.unique(impulse)
    if levels.size <= bins:
        groups = [np.flatnonzero(impulse == level) for level in levels]
    else:
        groups = np.array_split(np.argsort(impulse, kind="stable"), bins)
    return [(float(impulse[g].mean()), int((~recovered[g]).sum()), len(g)) for g in groups]
