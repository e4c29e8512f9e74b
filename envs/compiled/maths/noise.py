"""Pseudo-random numbers of compiled code: a generator whose state is one number of an array."""

import numpy as np

from poise.envs.compiled.jit import compiled

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_TO_UNIT = 1.0 / 9007199254740992.0  # 2⁻⁵³


@compiled
def uniform(state: np.ndarray) -> float:
    """The next number in [0, 1) of the generator whose state is `state` (1,) uint64 [Steele14].

    The state counts up by the golden ratio; its bits, mixed, are the number.
    """
    z = state[0] + _STEP
    state[0] = z
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    z = z ^ (z >> _31)
    return (z >> _11) * _TO_UNIT


@compiled
def add_noise(state: np.ndarray, deviation: float, out: np.ndarray):
    """Add to each entry of `out` (n,) a normal number of this standard deviation.

    The numbers come in pairs, r cos θ and r sin θ with r = √(−2 ln u) [Box58].
    """
    if deviation == 0.0:
        return
    n, i = out.shape[0], 0
    while i < n:
        radius = deviation * np.sqrt(-2.0 * np.log(1.0 - uniform(state)))
        angle = 2.0 * np.pi * uniform(state)
        out[i] += radius * np.cos(angle)
        if i + 1 < n:
            out[i + 1] += radius * np.sin(angle)
        i += 2


@compiled
def normal(state: np.ndarray) -> float:
    """The next number of the standard normal distribution."""
    radius = np.sqrt(-2.0 * np.log(1.0 - uniform(state)))
    return radius * np.cos(2.0 * np.pi * uniform(state))
