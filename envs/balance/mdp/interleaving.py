"""Policies that run more often than they were trained to.

A policy that was trained with steps of T observes frames that are T apart, and its last action.
It may run n times in T, so that its actions are less late: then n copies of it take turns, each
observing frames that are T apart. Frame j, counted back from 0, is

    o_j[t] = Σ_k w_k x[t − j n + k],  −n/2 ≤ k ≤ n/2,  Σ w_k = 1,

x[t] what a policy step measures and w equal, half of it at both ends where n is even: what all
copies observed around that time, so that sensor noise does not make them disagree. The newest
frame is x[t] itself, but for its last action, which was taken T before and is such a mean as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled

from .observation import Term


@dataclass(frozen=True, eq=False)
class Interleaving(Block):
    """What `interleave` works on."""

    past: np.ndarray  # (kept size,) frames of every policy step, the oldest first
    out: np.ndarray  # (history size,) frames that are T apart, the oldest first
    weights: np.ndarray  # (2 ⌊n/2⌋ + 1,) w
    acted: Annotated[np.ndarray, "size"]  # 1 for the entries that are of an action
    stride: int  # n


def kept_frames(history: int, stride: int) -> int:
    """Return how many policy steps an observation of `history` frames reaches back, beside itself:
    none where the stride is 1."""
    return history * stride + stride // 2 if stride > 1 else 0


def interleaving(
    terms: Sequence[Term], past: np.ndarray, out: np.ndarray, stride: int
) -> Interleaving:
    """Return the block of an observation of `terms`, see `Interleaving`."""
    weights = np.full(2 * (stride // 2) + 1, 1.0 / stride)
    if stride % 2 == 0:
        weights[[0, -1]] /= 2.0
    acted = np.concatenate([np.full(t.size, float(t.image == "actions")) for t in terms])
    return Interleaving(past=past, out=out, weights=weights, acted=acted, stride=stride)


@compiled
def interleave(a: Interleaving):
    """Fill the observation from the frames of all policy steps."""
    size, reach = a.acted.shape[0], a.weights.shape[0] // 2
    newest = a.past.shape[0] - size
    count = a.out.shape[0] // size
    for j in range(count):
        first = (count - 1 - j) * size
        for i in range(size):
            lag = j * a.stride
            if a.acted[i] > 0.5:
                lag += a.stride - 1  # a frame holds the action of one policy step before
            elif j == 0:
                a.out[first + i] = a.past[newest + i]
                continue
            mean = 0.0
            for k in range(-reach, reach + 1):
                mean += a.weights[k + reach] * a.past[newest - (lag + k) * size + i]
            a.out[first + i] = mean
