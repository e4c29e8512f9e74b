"""Evasion: a push changes the command that a standing robot observes.

A policy that is the mean of a network and of its mirror image has to choose the foot that steps,
again in every policy step; a push straight ahead or back does not tell it which. So from the moment
that the gyro shows a push the policy observes, for `HOLD`, an added velocity and turning rate,

    u = f(c + δ) + y + (A(θ), σ L(θ), σ T(θ)),  θ = atan2(`ROLL` |ω_x|, ω_y),  σ = −sgn(ω_x),

θ the direction of the push, 0 ahead, 180° back, σ = 1 to the left; of a push in the sagittal plane
the least sign of ω_x decides. What is chosen is kept: a push is shown by
√((`ROLL` ω_x)² + ω_y²) > `FELT` √(g/h), where none was within `AGAIN`. A robot that is to walk,
or was within `AGAIN`, does not evade. Nor does one that is pushed off its middle: |ω_z| is then
above `OFF` times that root.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays

ROLL = 2.0  # a push of one size turns the trunk about half as fast to the side as ahead
FELT = 0.3
HOLD = 0.5  # [s]
AGAIN = 1.5  # [s]
OFF = 1.0  # 0.9 at most of 93 pushes at the torso's middle; above it 8 of 12 at a shoulder


@dataclass(frozen=True, eq=False)
class Evasion(Block):
    """What `evade` works on."""

    state: StateArrays  # the one that the policy observes
    command: np.ndarray  # (8,) c, see `GaitCommand.array`
    knots: np.ndarray  # (n, 4) θ, A, L, T [°, m/s, m/s, rad/s]
    felt: Annotated[np.ndarray, 4]  # A, σ L, σ T of the last push; the time since then [s]
    shown: Annotated[np.ndarray, 3]  # what is added to what is observed [m/s, m/s, rad/s]
    omega: float  # √(g/h) [1/s]
    period: float  # of the policy step [s]


@compiled
def evade(e: Evasion):
    """Update what is added to the observed command, by a policy step."""
    if e.knots.shape[0] == 0:
        return
    roll, pitch = ROLL * e.state.qvel[3], e.state.qvel[4]
    e.felt[3] += e.period
    if e.command[0] != 0.0 or e.command[1] != 0.0 or e.command[2] != 0.0:
        e.felt[:] = 0.0
    size = np.hypot(roll, pitch)
    if e.felt[3] > AGAIN and size > FELT * e.omega:
        e.felt[:] = 0.0
        if abs(e.state.qvel[5]) <= OFF * size:
            angle, side = np.degrees(np.arctan2(abs(roll), pitch)), -1.0 if roll > 0.0 else 1.0
            for a in range(3):
                value = np.interp(angle, e.knots[:, 0], e.knots[:, 1 + a])
                e.felt[a] = value if a == 0 else side * value
    for a in range(3):
        e.shown[a] = e.felt[a] if e.felt[3] < HOLD else 0.0
