"""The horizontal force that pushes a robot, from its momentum and its CoP alone.

The balance of moments about the ground is off by what else pushes [Stephens07]:

    F_x = m c̈_x − (f_z/h) (c_x − p_x) + L̇_y/h,    F_y = m c̈_y − (f_z/h) (c_y − p_y) − L̇_x/h

c, ċ, p, the ground's force f_z and the angular momentum L about the CoM are those of the state that
a controller reads, so that nothing is known here that a robot does not measure. c̈ and L̇ are
differences over a tick. F is that of a force at the height h of the CoM: one at z counts by the
moment that it has about the ground, F z/h.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays, borne_weight

SMOOTHING = 0.7  # [1/ω] τ of the estimate, unless a controller has its own
MEMORY = 20.0  # [1/ω] T of its mean, unless a controller has its own
SUPPORTED = 0.1  # [m g] of the ground's force, below which there is no CoP to go by


@dataclass(eq=False)
class PushForce(Block):
    """The estimated force, world axes, and the mean of it over the last seconds."""

    smoothing: float  # τ of the low-pass [s]
    memory: float  # T of the leaky mean [s]
    force: Annotated[np.ndarray, 2]  # F̂ [N]
    mean: Annotated[np.ndarray, 2]  # F̄ [N]
    size: Mutable[float]  # the leaky mean of |F̂| [N]
    com_vel: Annotated[np.ndarray, 2]  # of the last tick [m/s]
    turning: Annotated[np.ndarray, 2]  # L_x, L_y of the last tick [N·m·s]
    begun: Mutable[int]  # 1 once there was a tick


def push_force(omega: float, smoothing: float = SMOOTHING, memory: float = MEMORY) -> PushForce:
    """An estimate that has seen nothing; times in 1/ω, `omega` ω [1/s]."""
    return PushForce.allocate(smoothing=smoothing / omega, memory=memory / omega)


def forget_pushes(b: PushForce) -> None:
    """Start an episode, in which nothing has pushed yet."""
    b.force[:], b.mean[:] = 0.0, 0.0
    b.size, b.begun = 0.0, 0


@compiled
def observe_push(b: PushForce, robot: RobotArrays, s: StateArrays, dt: float) -> None:
    """Update the force and its mean by a state that is `dt` [s] later than the last one:

    F̂ ← F̂ + dt/(τ + dt) (F − F̂),    F̄ ← F̄ + dt/(T + dt) (F̂ − F̄)

    Without support there is no CoP, and both stay as they are.
    """
    weight = borne_weight(robot, s)
    if b.begun and s.contact_wrench[2] > SUPPORTED * weight:
        height = max(s.com[2] - s.origin[2], 0.2 * robot.height_com)
        stiffness = s.contact_wrench[2] / height
        rate, leak = dt / (b.smoothing + dt), dt / (b.memory + dt)
        for a in range(2):
            inertial = robot.mass * (s.com_vel[a] - b.com_vel[a]) / dt
            sign, across = 1.0 - 2.0 * a, 1 - a
            turned = sign * (s.momentum[3 + across] - b.turning[across]) / (dt * height)
            force = inertial - stiffness * (s.com[a] - s.cop[a]) + turned
            b.force[a] += rate * (force - b.force[a])
            b.mean[a] += leak * (b.force[a] - b.mean[a])
        size = np.sqrt(b.force[0] * b.force[0] + b.force[1] * b.force[1])
        b.size += leak * (size - b.size)
    for a in range(2):
        b.com_vel[a] = s.com_vel[a]
        b.turning[a] = s.momentum[3 + a]
    b.begun = 1
