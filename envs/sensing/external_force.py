"""The force on a robot that nothing explains: what pushes it, from how its momentum changes.

The momentum of all bodies changes by the ground, by gravity, and by what else there is [Flacco16]:

    Ṗ = f_ground + m g + f,    L̇ = n_ground + n

P and L are about the centre of mass, and the ground's wrench is measured. A push lasts for many
times what a state is late, so that f and n of the last tick are those of the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .measurement import Rings

KEEP, CLEAR, LEARN, SPREAD_TIME = 0.5, 3.0, 25, 1.0


@dataclass(frozen=True, eq=False)
class ExternalForce(Block):
    """The wrench that nothing explains, world axes, about the centre of mass."""

    wrench: np.ndarray  # (6,) force [N], moment [N·m]
    acceleration: np.ndarray  # (6,) that it gives the root of the robot, its joints held: world axes
    momentum: np.ndarray  # (6,) at the physics step `seen`
    seen: np.ndarray  # (1,) int; -1 before the first one
    smooth: np.ndarray  # (6,) low-passed, before it is weighed
    spread: np.ndarray  # (2,) mean squares of force and moment, of what is noise
    ticks: np.ndarray  # (1,) int


def allocate_force() -> ExternalForce:
    """No force, of a robot that was not seen yet."""
    zeros = guarded_zeros
    return ExternalForce(zeros(6), zeros(6), zeros(6), zeros(1, np.int64), zeros(6), zeros(2), zeros(1, np.int64))


def begin_force(e: ExternalForce) -> None:
    """Start an episode."""
    e.wrench[:] = e.acceleration[:] = e.momentum[:] = 0.0
    e.smooth[:], e.spread[:], e.ticks[0] = 0.0, 0.0, 0
    e.seen[0] = -1


@compiled
def observe_force(e: ExternalForce, robot: RobotArrays, s: StateArrays, r: Rings, now: int, exact: bool):
    """The mean wrench from the physics step `seen` to `now`, whose state is `s`."""
    steps, n = now - e.seen[0], r.wrench.shape[0]
    if steps <= 0 or steps > n - 2:
        return
    newest = r.next[0] - 1 - (r.count[0] - 1 - now)
    if e.seen[0] >= 0:
        dt = steps * robot.timestep
        for a in range(6):
            e.wrench[a] = (s.momentum[a] - e.momentum[a]) / dt
        e.wrench[2] += robot.mass * robot.gravity
        for i in range(steps):
            w = r.wrench[(newest - i) % n]
            fx, fy, fz = 0.0, 0.0, 0.0
            for b in range(3):
                fx += s.root_axes[0, b] * w[b]
                fy += s.root_axes[1, b] * w[b]
                fz += s.root_axes[2, b] * w[b]
            # the moment about the root, told about the centre of mass
            x, y, z = s.qpos[0] - s.com[0], s.qpos[1] - s.com[1], s.qpos[2] - s.com[2]
            moment = (y * fz - z * fy, z * fx - x * fz, x * fy - y * fx)
            e.wrench[0] -= fx / steps
            e.wrench[1] -= fy / steps
            e.wrench[2] -= fz / steps
            for a in range(3):
                turned = moment[a]
                for b in range(3):
                    turned += s.root_axes[a, b] * w[3 + b]
                e.wrench[3 + a] -= turned / steps
        if not exact:
            _weigh(e, dt)
        _accelerate(e, robot, s)
    for a in range(6):
        e.momentum[a] = s.momentum[a]
    e.seen[0] = now


@compiled
def _weigh(e: ExternalForce, dt: float):
    e.ticks[0] += 1
    rate = max(1.0 / e.ticks[0], dt / SPREAD_TIME)
    for part in range(2):
        square = 0.0
        for a in range(3 * part, 3 * part + 3):
            e.smooth[a] += KEEP * (e.wrench[a] - e.smooth[a])
            square += e.smooth[a] * e.smooth[a]
        noise = e.spread[part]
        clear = max(1.0 - CLEAR * CLEAR * noise / max(square, 1e-12), 0.0)
        if e.ticks[0] <= LEARN:
            clear = 0.0
        else:
            square = min(square, CLEAR * CLEAR * noise)
        e.spread[part] += rate * (square - noise)
        for a in range(3 * part, 3 * part + 3):
            e.wrench[a] = clear * e.smooth[a]


@compiled
def _accelerate(e: ExternalForce, robot: RobotArrays, s: StateArrays):
    """v̇ = f/m + ω̇ × (x − c), ω̇ = I⁻¹ n with the inertia I of all bodies as one."""
    I = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            I[a, b] = 0.0
            for c in range(3):  # A's columns are of turns about root axes
                I[a, b] += s.A[3 + a, 3 + c] * s.root_axes[b, c]
    spin = np.linalg.solve(I, e.wrench[3:])
    x, y, z = s.qpos[0] - s.com[0], s.qpos[1] - s.com[1], s.qpos[2] - s.com[2]
    e.acceleration[0] = e.wrench[0] / robot.mass + spin[1] * z - spin[2] * y
    e.acceleration[1] = e.wrench[1] / robot.mass + spin[2] * x - spin[0] * z
    e.acceleration[2] = e.wrench[2] / robot.mass + spin[0] * y - spin[1] * x
    for a in range(3):
        e.acceleration[3 + a] = spin[a]
