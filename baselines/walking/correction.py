"""The velocity of a walk, corrected by leg odometry.

The foot that is lower bears the robot and rests, so that joints, gyro and attitude give the
velocity of the CoM: v = ċ − ṡ, s the point of that sole. Neither term is measured alone, their
difference is.
What a `Calibration` misses of a robot, its loads and its delays is then integrated,

    δ ← clip(δ + k T (c − v̄), −most, most),

v̄ the mean of v over `MEAN_TIME`, T the policy step, and the policy observes f(c + δ). The turning
rate, which the gyro gives, has a δ as well.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along
from poise.envs.physics.kinematics import StateArrays

MEAN_TIME = 0.5  # [s] of a low-pass: the sway of a stride is averaged out, a stop is not
MOST = 0.2  # [m/s], [rad/s] of δ


@dataclass(frozen=True, eq=False)
class Correction(Block):
    """What `correct_course` works on."""

    state: StateArrays  # the one that the policy observes
    command: np.ndarray  # (8,) see `GaitCommand.array`
    found: Annotated[np.ndarray, 3]  # v of this policy step ahead, left, and the turning rate
    mean: Annotated[np.ndarray, 3]  # v̄ ahead, left [m/s], of the turning rate [rad/s]
    shift: Annotated[np.ndarray, 3]  # δ
    part: float  # 1 − exp(−T / `MEAN_TIME`)
    rate: float  # k T


@compiled
def turn_rate(s: StateArrays) -> float:
    """Of the root about the vertical [rad/s]."""
    turn = 0.0
    for a in range(3):
        turn += s.root_axes[2, a] * s.qvel[3 + a]
    return turn


@compiled
def odometry(s: StateArrays) -> tuple[float, float, float]:
    """Velocity ahead and to the left [m/s], and the turning rate [rad/s], by the lower foot."""
    lower = 0
    for i in range(1, s.sole_point.shape[0]):
        if s.sole_point[i, 2] < s.sole_point[lower, 2]:
            lower = i
    x, y = s.com_vel[0] - s.J_v[6 * lower], s.com_vel[1] - s.J_v[6 * lower + 1]
    ahead, left = along(s.heading[0], s.heading[1], x, y)
    return ahead, left, turn_rate(s)


@compiled
def correct_course(c: Correction):
    """Update v̄ and δ by a policy step. δ is zero while the command is to stand; that of the speeds
    is zero while it is to turn in place."""
    c.found[0], c.found[1], c.found[2] = odometry(c.state)
    walks = c.command[0] != 0.0 or c.command[1] != 0.0
    for a in range(3):
        c.mean[a] += c.part * (c.found[a] - c.mean[a])
        shift = c.shift[a] + c.rate * (c.command[a] - c.mean[a])
        active = walks or (a == 2 and c.command[2] != 0.0)
        c.shift[a] = min(max(shift, -MOST), MOST) if active else 0.0
