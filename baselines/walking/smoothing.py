"""Smoothing: the targets of a robot that stands calmly are a low-pass of the policy's.

A policy that acts every few milliseconds hands the noise of the sensors on to the motors. With the
gyro's rate ω and q(k) the joint positions that the policy asks for, the servos are asked for

    q*(k) = q*(k−1) + α (q(k) − q*(k−1)),
    α = min(max(√(ω_x² + ω_y²) / (`FELT` √(g/h)), α₀), 1)

where no velocity is commanded; else q* = q. A push is answered at once, since α is 1 then.
"""

from dataclasses import dataclass

import numpy as np

from poise.envs.balance.servos import Servos
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays

from .evasion import FELT


@dataclass(frozen=True, eq=False)
class Smoothing(Block):
    """What `aim_smoothly` works on."""

    state: StateArrays  # the one that the policy observes
    command: np.ndarray  # (8,) c, see `GaitCommand.array`
    least: float  # α₀
    omega: float  # √(g/h) [1/s]


@compiled
def aim_smoothly(s: Smoothing, servos: Servos, action: np.ndarray):
    """Update the servos' targets by a policy step, whose `action` is (nu,)."""
    part = 1.0
    if s.command[0] == 0.0 and s.command[1] == 0.0 and s.command[2] == 0.0:
        size = np.hypot(s.state.qvel[3], s.state.qvel[4])
        part = min(max(size / (FELT * s.omega), s.least), 1.0)
    for i in range(servos.target.shape[0]):
        asked = servos.hold[i] + servos.reach[i] * action[i]
        if part < 1.0:
            asked = servos.target[i] + part * (asked - servos.target[i])
        servos.target[i] = asked
