"""Turns of a clip's steps, spread over the steps around where one step turns too far."""

import numpy as np
from scipy.optimize import lsq_linear

from .own_steps import BEND, MOST_TURN, SHARE

CLOSE = np.radians(3.0)  # [rad] of the heading at the end
TOTAL = 10.0  # weight of that end among the headings of the steps


def spread_rates(
    each: list[tuple[float, float, float]], rates: np.ndarray, going: np.ndarray, unit: float
) -> np.ndarray:
    """Turning rates (n,) [rad/s] of steps that turn no further than a planner can, where steps
    around those that do can take the rest; else the `rates`.

    `each` has begin and end of each step, and what it lasts [s]; `going` (n,) are speeds, `unit` is
    hω [m/s]. Steps bend less than a planner can at 0.7 of their speed, where possible.
    """
    lasts = np.array([end - start for start, end, _ in each])
    share = lasts / [own for *_, own in each]
    straight = np.full_like(rates, MOST_TURN)
    if (np.abs(rates * lasts) <= straight * share).all():
        return rates
    bends = np.minimum(BEND * unit / np.maximum(SHARE * going, 1e-9), MOST_TURN)
    for most in (bends, straight):
        spread = spread_turns(rates * lasts, most * share)
        if spread is not None:
            return spread / lasts
    return rates


def spread_turns(angles: np.ndarray, most: np.ndarray) -> np.ndarray | None:
    """The angles b (n,) by which steps turn [rad], none beyond `most` (n,), whose headings are
    nearest to those of the `angles` a (n,):

        min Σ_k w_k (Σ_{i≤k} b_i − a_i)²,  |b_i| ≤ most_i,

    w_k = 1, and 100 at the end. None where the last heading is further off than 3°.
    """
    sums = np.tril(np.ones((len(angles), len(angles))))
    sums[-1] *= TOTAL
    found = lsq_linear(sums, sums @ angles, bounds=(-most, most), tol=1e-12).x
    return found if abs(float(np.sum(found - angles))) < CLOSE else None
