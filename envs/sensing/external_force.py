"""The force on a robot that nothing explains: what pushes it, from how its momentum changes.

The momentum of all bodies changes by the ground, by gravity, and by what else there is [Flacco16]:

    Ṗ = f_ground + m g + f,    L̇ = n_ground + n

P and L are about the centre of mass, and the ground's wrench is measured. A push lasts for many
times what a state is late by, so that f and n of now are those that act until torques do. What
lasts for longer is a load: the robot is heavier than it is known to be, or elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .measurement import Rings

SMOOTHING = 0.5  # of a new wrench in its low-pass, where sensors err
CLEAR = 3.0  # deviations of the noise, below which there is no force
LEARNING = 25  # ticks of an episode that measure the noise alone
MEMORY = 1.0  # [s] in which the noise is forgotten
QUICK = 0.04  # [s] over which a wrench is averaged before it counts for a load
START = 0.2  # [s] in which a load is learned at first
CLIP, MOST = 0.05, 0.4  # of the weight: by which the mean is off at most, and what a load may be
ARM = 0.2  # [h] at which such a part of the weight makes a moment


@dataclass(eq=False)
class ExternalForce(Block):
    """The wrench that nothing explains: force [N] and moment about the CoM [N·m], world axes."""

    wrench: Annotated[np.ndarray, 6]  # the estimate
    smooth: Annotated[np.ndarray, 6]  # low-passed
    noise: Annotated[np.ndarray, 2]  # mean squares of its force and of its moment
    momentum: Annotated[np.ndarray, 6]  # at the physics step `seen`
    mean: Annotated[np.ndarray, 3]  # f_z, n_x, n_y over `QUICK`
    load: Annotated[np.ndarray, 3]  # what of them lasts
    time: Mutable[float]  # in which that is learned [s]
    seen: Mutable[int]  # -1 before the first one
    ticks: Mutable[int]  # wrenches until now


def begin_force(e: ExternalForce, load_time: float) -> None:
    """Start an episode, in which nothing was seen yet.

    A load is learned in `load_time` [s], or not at all if that is 0.
    """
    for array in (e.wrench, e.smooth, e.noise, e.mean, e.load):
        array[:] = 0.0
    e.time, e.seen, e.ticks = load_time, -1, 0


@compiled
def observe_force(
    e: ExternalForce, robot: RobotArrays, s: StateArrays, r: Rings, now: int, exact: bool
):
    """The mean wrench since it was last asked for; `s` is the state after the physics step `now`.

    Where the state is not `exact`, the wrench is low-passed and weighed by `_weigh`.
    """
    steps, n = now - e.seen, r.wrench.shape[0]
    if steps <= 0:
        return
    if e.seen >= 0:
        dt = steps * robot.timestep
        for a in range(6):
            e.wrench[a] = (s.momentum[a] - e.momentum[a]) / dt
        e.wrench[2] += robot.mass * robot.gravity
        _take_ground(e, s, r, now, min(steps, n))
        if e.time > 0.0:
            _learn_load(e, robot, dt)
        e.ticks += 1
        if not exact:
            for a in range(3):
                e.wrench[2 + a] -= e.load[a]
            _weigh(e, dt)
            for a in range(3):
                e.wrench[2 + a] += e.load[a]
    for a in range(6):
        e.momentum[a] = s.momentum[a]
    e.seen = now


@compiled
def keep_load(e: ExternalForce):
    """Let the load be all that is known of the wrench."""
    e.wrench[:] = 0.0
    for a in range(3):
        e.wrench[2 + a] = e.load[a]


@compiled
def _take_ground(e: ExternalForce, s: StateArrays, r: Rings, now: int, steps: int):
    """Subtract the ground's wrench about the CoM, the mean of `steps` measurements."""
    n, R = r.wrench.shape[0], s.root_axes
    newest = r.next - 1 - (r.count - 1 - now)
    x, y, z = s.qpos[0] - s.com[0], s.qpos[1] - s.com[1], s.qpos[2] - s.com[2]
    for i in range(steps):
        w = r.wrench[(newest - i) % n]
        for a in range(3):
            for b in range(3):
                e.wrench[a] -= R[a, b] * w[b] / steps
                e.wrench[3 + a] -= R[a, b] * w[3 + b] / steps
        fx = R[0, 0] * w[0] + R[0, 1] * w[1] + R[0, 2] * w[2]
        fy = R[1, 0] * w[0] + R[1, 1] * w[1] + R[1, 2] * w[2]
        fz = R[2, 0] * w[0] + R[2, 1] * w[1] + R[2, 2] * w[2]
        e.wrench[3] -= (y * fz - z * fy) / steps
        e.wrench[4] -= (z * fx - x * fz) / steps
        e.wrench[5] -= (x * fy - y * fx) / steps


@compiled
def _weigh(e: ExternalForce, dt: float):
    """Low-pass the wrench, and let force and moment count as far as they are above the noise:

        f ← max(1 − (CLEAR σ/|f|)², 0) f

    σ² is the mean square of what has been seen, of which what is above CLEAR σ counts as that: the
    errors of a robot that steps grow at once, and are not to be taken for a push.
    """
    rate = max(1.0 / e.ticks, dt / MEMORY)
    for part in range(2):
        square, most = 0.0, CLEAR * CLEAR * e.noise[part]
        for a in range(3 * part, 3 * part + 3):
            e.smooth[a] += SMOOTHING * (e.wrench[a] - e.smooth[a])
            square += e.smooth[a] * e.smooth[a]
        weight = 0.0
        if e.ticks > LEARNING and square > most:
            weight, square = 1.0 - most / square, most
        e.noise[part] += rate * (square - e.noise[part])
        for a in range(3 * part, 3 * part + 3):
            e.wrench[a] = weight * e.smooth[a]


@compiled
def _learn_load(e: ExternalForce, robot: RobotArrays, dt: float):
    """Let the load follow the mean wrench in `time`, or in the time since the start:

        load ← load + dt/T clip(mean − load, ± CLIP)

    so that a push, which is over soon, counts little.
    """
    weight = robot.mass * robot.gravity
    gentle, rate = dt / (QUICK + dt), dt / max(min(e.ticks * dt, e.time), START)
    for a in range(3):
        unit = weight if a == 0 else ARM * weight * robot.height_com
        e.mean[a] += gentle * (e.wrench[2 + a] - e.mean[a])
        error = min(max(e.mean[a] - e.load[a], -CLIP * unit), CLIP * unit)
        e.load[a] = min(max(e.load[a] + rate * error, -MOST * unit), MOST * unit)


@compiled
def bear_load(e: ExternalForce, robot: RobotArrays, s: StateArrays):
    """Write the load into the dynamics of `s`: h, A_bias, and where the centre of mass is.

    At rest the CoP lies below c + δ, δ = [n_y, −n_x]/(m g − f_z), and what `s` has of the CoM is
    about that point then.
    """
    f, mx, my = e.load[0], e.load[1], e.load[2]
    copy_into(e.load, s.load)
    weight, R = robot.mass * robot.gravity - f, s.root_axes
    dx, dy = my / weight, -mx / weight
    s.A_bias[2] -= f
    s.A_bias[3] -= mx
    s.A_bias[4] -= my
    _move_moments(s.A_bias, dx, dy)
    _move_moments(s.momentum, dx, dy)
    for j in range(s.A.shape[1]):
        _move_moments(s.A[:, j], dx, dy)
    mx += (s.com[1] - s.qpos[1]) * f
    my -= (s.com[0] - s.qpos[0]) * f
    s.h[2] -= f
    for a in range(3):
        s.h[3 + a] -= R[0, a] * mx + R[1, a] * my
    for point in (s.com, s.capture_point):
        point[0] += dx
        point[1] += dy


@compiled
def _move_moments(wrench: np.ndarray, dx: float, dy: float):
    """Tell a wrench (6,), or a momentum, about a point that is beside the old one by dx, dy."""
    wrench[3] -= dy * wrench[2]
    wrench[4] += dx * wrench[2]
    wrench[5] -= dx * wrench[1] - dy * wrench[0]
