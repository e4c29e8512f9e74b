"""Admittance: a walk gives way to a push before it brakes.

A push changes the velocity at once. To bring it back at once needs forces that a late motor on
slippery ground does not give, so for some 0.5 s the policy observes a velocity that goes with it,

    u = f(c + δ) + y,  y = κ max(1 − d/‖w − c‖, 0) (w − v̄),  |y_a| ≤ `MOST`,

w the velocity by leg odometry, low-passed with `QUICK_TIME`, v̄ its mean and δ the correction of
`correction.py`, d `DEAD`. y = 0 where (w − v̄)·(w − c) < 0: what leads to the command is no push,
the robot begins to walk, or brakes.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled

QUICK_TIME = 0.1  # [s] of w
DEAD = 0.3  # [m/s]
MOST = 1.0  # [m/s]


@dataclass(frozen=True, eq=False)
class Admittance(Block):
    """What `give_way` works on."""

    command: np.ndarray  # (8,) c, see `GaitCommand.array`
    found: Annotated[np.ndarray, 3]  # by leg odometry, of a `Correction`, as v̄ is
    mean: Annotated[np.ndarray, 3]  # v̄
    quick: Annotated[np.ndarray, 2]  # w ahead, left [m/s]
    way: Annotated[np.ndarray, 2]  # y
    part: float  # 1 − exp(−T / `QUICK_TIME`)
    gain: float  # κ


@compiled
def give_way(a: Admittance):
    """Update w and y by a policy step, after those of `correct_course`."""
    for i in range(2):
        a.quick[i] += a.part * (a.found[i] - a.quick[i])
    x, y = a.quick[0] - a.mean[0], a.quick[1] - a.mean[1]
    error_x, error_y = a.quick[0] - a.command[0], a.quick[1] - a.command[1]
    error = np.hypot(error_x, error_y)
    leaves = error > DEAD and x * error_x + y * error_y > 0.0
    gain = a.gain * (1.0 - DEAD / error) if leaves else 0.0
    a.way[0] = min(max(gain * x, -MOST), MOST)
    a.way[1] = min(max(gain * y, -MOST), MOST)
