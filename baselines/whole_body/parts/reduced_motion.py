"""The motion of a robot in the unknowns of the reduced problem."""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block


@dataclass(frozen=True, eq=False)
class ReducedMotion(Block):
    """v̇ = V x + v̇₀, the total contact wrench W = B x + W₀ and joint torques τ = T x + τ₀.

    Of the unknowns x those from `first` to `last` are accelerations that leave the contacts as
    they are: these columns of V span the null space of the contacts' Jacobian.
    """

    V: np.ndarray  # (nv, n)
    vdot0: np.ndarray  # (nv,)
    B: np.ndarray  # (6, n)
    T: np.ndarray  # (nv−6, n)
    tau0: np.ndarray  # (nv−6,)
    first: int
    last: int
