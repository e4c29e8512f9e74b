"""Admittance: a walk gives way to a push before it brakes.

A push changes the velocity at once. To bring it back at once needs forces that a late motor on
slippery ground does not give, so for some 0.5 s the policy observes a velocity that goes with it,

    u = f(c + δ) + y,  y = κ D(w − v̄),  D(e) = max(1 − d/‖e‖, 0) e,  |y_a| ≤ `MOST`,

w the velocity by leg odometry, low-passed with `QUICK_TIME`, v̄ its mean and δ the correction of
`correction.py`, d `DEAD`: the sway of a stride is no push.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays

from .correction import odometry

QUICK_TIME = 0.1  # [s] of w
DEAD = 0.3  # [m/s]
MOST = 1.0  # [m/s]


@dataclass(frozen=True, eq=False)
class Admittance(Block):
    """What `give_way` works on."""

    state: StateArrays  # the one that the policy observes
    mean: Annotated[np.ndarray, 3]  # v̄ of a `Correction`
    quick: Annotated[np.ndarray, 2]  # w ahead, left [m/s]
    way: Annotated[np.ndarray, 2]  # y
    part: float  # 1 − exp(−T / `QUICK_TIME`)
    gain: float  # κ


@compiled
def give_way(a: Admittance):
    """Update w and y by a policy step, after v̄."""
    ahead, left, _ = odometry(a.state)
    a.quick[0] += a.part * (ahead - a.quick[0])
    a.quick[1] += a.part * (left - a.quick[1])
    x, y = a.quick[0] - a.mean[0], a.quick[1] - a.mean[1]
    size = np.hypot(x, y)
    gain = a.gain * (1.0 - DEAD / size) if size > DEAD else 0.0
    a.way[0] = min(max(gain * x, -MOST), MOST)
    a.way[1] = min(max(gain * y, -MOST), MOST)
