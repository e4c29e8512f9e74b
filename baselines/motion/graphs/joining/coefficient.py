"""How hard it is to go from one state to another: a coefficient in closed form.

Semakin's dissertation has such a coefficient, "found empirically", and does not print it. This one
is the least bending energy of a cubic join, weighted by what the joints move.
"""

from typing import NamedTuple

import numpy as np

from poise.baselines.motion.clips.skeleton import Skeleton
from poise.configs.errors import ConfigError
from poise.configs.problems import out_of_range

LEAST, MOST = 0.2, 2.0  # [s] durations that are looked at


class Price(NamedTuple):
    """The coefficient K at its best duration D [s]."""

    coefficient: float
    duration: float


def coefficient(
    gap: np.ndarray, before: np.ndarray, after: np.ndarray, masses: np.ndarray, duration: float
) -> np.ndarray:
    """K(D) = Σ mᵢ [12/D³ ‖Δᵢ − D v̄ᵢ‖² + ‖Δvᵢ‖²/D], summed over the last axis.

    It is ∫‖ẍ‖² dt of the cubic that goes from 0 to Δ in D with the rates v_a and v_b.

    Args:
        gap: (…, n) Δ, from the one posture to the other.
        before, after: (…, n) rates v_a and v_b; v̄ is their mean, Δv their difference.
        masses: (n,) mᵢ ≥ 0.
        duration: D [s].

    Raises:
        ConfigError: a duration that is not above 0.
    """
    if not duration > 0.0:
        raise out_of_range(duration, field="duration", above=0, form="g")
    mean, change = 0.5 * (before + after), after - before
    bent = 12.0 * (gap - duration * mean) ** 2 / duration**3 + change**2 / duration
    return np.asarray(bent @ masses)


def best_duration(
    gap: np.ndarray, before: np.ndarray, after: np.ndarray, masses: np.ndarray,
    least: float = LEAST, most: float = MOST, time_price: float = 0.0,
) -> Price:  # fmt: skip
    """The least K(D) + λ D over D between `least` and `most` [s], with λ the `time_price`.

    Its stationary points are the roots of λ D⁴ − (12 v̄² + Δv²) D² + 48 Δ·v̄ D − 36 Δ², squares and
    products weighted by the masses; they and both ends are compared. `coefficient` is K alone.
    """
    if not 0.0 < least <= most:
        raise ConfigError(f"must be two times above 0, in order, not {least:g} and {most:g}",
                          field="duration")  # fmt: skip
    mean, change = 0.5 * (before + after), after - before
    square, product = float(gap**2 @ masses), float((gap * mean) @ masses)
    moving = float((12.0 * mean**2 + change**2) @ masses)
    roots = np.roots([time_price, 0.0, -moving, 48.0 * product, -36.0 * square])
    inside = [root.real for root in roots if abs(root.imag) < 1e-9 and least < root.real < most]
    prices = [
        (float(coefficient(gap, before, after, masses, d)) + time_price * d, d)
        for d in (least, most, *inside)
    ]
    whole, duration = min(prices)
    return Price(whole - time_price * duration, float(duration))


def moved_shares(skeleton: Skeleton) -> np.ndarray:
    """(3 + 3J,) masses for `coefficient` of a skeleton: what each joint moves, over the whole.

    A file of motion capture knows no masses: bones count by their lengths. The root moves all.
    """
    count = len(skeleton.names)
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    lengths[0] = 0.0
    below = np.zeros(count)
    ends = np.linalg.norm(skeleton.end_offsets, axis=1)
    np.add.at(below, skeleton.end_parents, ends)
    for joint in range(count - 1, 0, -1):  # parents come first
        below[skeleton.parents[joint]] += below[joint] + lengths[joint]
    return np.concatenate([np.ones(3), np.repeat(below / below[0], 3)])
