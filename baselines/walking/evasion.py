"""Evasion: a robot that stands turns as it is pushed.

A policy that is the mean of a network and of its mirror image has to choose the foot that steps,
again in every policy step; a push from straight ahead does not tell it which. So from the moment
that the gyro shows a push the policy observes, for `HOLD`, a turning rate besides,

    u_ψ = f(c_ψ + δ_ψ) + σ T(θ),  θ = atan2(`ROLL` |ω_x|, ω_y),  σ = −sgn(ω_x),

θ the direction of the push, 0 ahead, 180° back, σ = 1 to the left; of a push in the sagittal plane
the least sign of ω_x decides. What is chosen is kept: a push is shown by
√((`ROLL` ω_x)² + ω_y²) > `FELT` √(g/h), where none was within `AGAIN`. A robot that is to walk,
or was within `AGAIN`, does not evade.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays

from .calibration import through

ROLL = 2.0  # a push of one size turns the trunk about half as fast to the side as ahead
FELT = 0.3
HOLD = 0.6  # [s]
AGAIN = 1.5  # [s]


@dataclass(frozen=True, eq=False)
class Evasion(Block):
    """What `evade` works on."""

    state: StateArrays  # the one that the policy observes
    command: np.ndarray  # (8,) c, see `GaitCommand.array`
    knots: np.ndarray  # (n, 2) of T [°, rad/s]
    felt: Annotated[np.ndarray, 2]  # time since the last push [s]; σ T(θ) of it [rad/s]
    turn: Annotated[np.ndarray, 1]  # what is observed besides [rad/s]
    omega: float  # √(g/h) [1/s]
    period: float  # of the policy step [s]


@compiled
def evade(e: Evasion):
    """Update what is observed besides, by a policy step."""
    roll, pitch = ROLL * e.state.qvel[3], e.state.qvel[4]
    e.felt[0] += e.period
    walks = e.command[0] != 0.0 or e.command[1] != 0.0 or e.command[2] != 0.0
    if walks:
        e.felt[0], e.felt[1] = 0.0, 0.0
    if e.knots.shape[0] > 0 and e.felt[0] > AGAIN and np.hypot(roll, pitch) > FELT * e.omega:
        angle = np.degrees(np.arctan2(abs(roll), pitch))
        e.felt[0] = 0.0
        e.felt[1] = through(e.knots, angle) * (-1.0 if roll > 0.0 else 1.0)
    e.turn[0] = e.felt[1] if e.felt[0] < HOLD else 0.0
