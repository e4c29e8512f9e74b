"""Differences and ratios of two estimates, with intervals made of the intervals of the two."""

from collections.abc import Sequence

import numpy as np

from .rates import Interval, wilson_interval

Range = Sequence[float]  # (low, high)
Open = Sequence[float | None] | None  # the same, with possibly unknown ends


def difference(
    a: float, a_ci: Range, b: float, b_ci: Range, correlation: float = 0.0
) -> tuple[float, Interval]:
    """b − a and its interval, from those of a and b [Zou08], "MOVER".

        low  = (b − a) − √((b − b_l)² + (a_u − a)² − 2 ρ (b − b_l)(a_u − a))
        high = (b − a) + √((b_u − b)² + (a − a_l)² − 2 ρ (b_u − b)(a − a_l))

    With Wilson intervals of two proportions this is Newcombe's method 10 [Newcombe98].

    Args:
        a, b: estimates, with intervals of one confidence.
        correlation: ρ of the two estimates; 0: independent.
    """
    (a, b), a_ci, b_ci = (float(a), float(b)), list(map(float, a_ci)), list(map(float, b_ci))
    below_b, above_b = b - b_ci[0], b_ci[1] - b
    below_a, above_a = a - a_ci[0], a_ci[1] - a

    def reach(x: float, y: float) -> float:
        return float(np.sqrt(max(x * x + y * y - 2.0 * correlation * x * y, 0.0)))

    gap = b - a
    return gap, Interval(gap - reach(below_b, above_a), gap + reach(above_b, below_a))


def relative_gain(
    a: float, a_ci: Open, b: float, b_ci: Open
) -> tuple[float, Interval] | tuple[None, None]:
    """b/a − 1 and its interval, from the difference of the logarithms [Zou08].

    None where an end of an interval is unknown or a value is not positive.
    """
    known = [end for end in (*(a_ci or ()), *(b_ci or ())) if end is not None]
    if len(known) < 4 or min(a, b, *known) <= 0.0:
        return None, None
    logs = np.log(known).tolist()
    gap, ends = difference(float(np.log(a)), logs[:2], float(np.log(b)), logs[2:])
    return float(np.expm1(gap)), Interval(float(np.expm1(ends[0])), float(np.expm1(ends[1])))


def ratio(a: float, a_ci: Open, b: float, b_ci: Open) -> tuple[float, Interval] | tuple[None, None]:
    """b/a and its interval, or None, as `relative_gain`."""
    gain, ends = relative_gain(a, a_ci, b, b_ci)
    if gain is None or ends is None:
        return None, None
    return 1.0 + gain, Interval(1.0 + ends.low, 1.0 + ends.high)


def paired_rates(both: int, only_a: int, only_b: int, neither: int) -> tuple[float, Interval]:
    """Return the difference of two recovered rates on the same trials, b − a, with its 95 %
    interval.

    Newcombe's square-and-add interval for paired proportions [Newcombe98b], without a continuity
    correction: `difference` of the Wilson intervals with ρ = φ, the correlation of the 2×2 table.

    Raises ValueError for a negative count or no trial.
    """
    counts = (both, only_a, only_b, neither)
    trials = sum(counts)
    if min(counts) < 0 or trials == 0:
        raise ValueError(f"counts must not be negative and not all zero: {counts}")
    won_a, won_b = both + only_a, both + only_b
    margins = won_a * won_b * (trials - won_a) * (trials - won_b)
    phi = (both * neither - only_a * only_b) / np.sqrt(margins) if margins else 0.0
    a, b = won_a / trials, won_b / trials
    ends_a, ends_b = wilson_interval(won_a, trials), wilson_interval(won_b, trials)
    return difference(a, ends_a, b, ends_b, float(phi))
