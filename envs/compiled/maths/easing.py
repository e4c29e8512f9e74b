"""The way from rest to rest: one formula, for arrays and for compiled code."""

import numpy as np

from poise.envs.compiled.jit import compiled


def ease(u: np.ndarray) -> np.ndarray:
    """α(u) = 10u³ − 15u⁴ + 6u⁵ for u from 0 to 1: from 0 to 1, with neither velocity nor
    acceleration at both ends; of all such ways the one with the least jerk [Flash85]."""
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u**2))


@compiled
def eased(u: float) -> float:
    """The same of one number in compiled code."""
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))
