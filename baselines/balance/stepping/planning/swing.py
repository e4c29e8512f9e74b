"""The way of a swing foot: C² from wherever it is to a foothold that may move on the way."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.mutable import Mutable

from .config import SwingTask
from .units import in_si

LANDING = 0.6  # fraction of a swing after which contact is touchdown, not the lift-off
FROZEN = 0.03  # [s] before touchdown the foothold no longer moves


@dataclass(eq=False)
class Swing(Block):
    """The reference of one swing foot's sole, replanned each tick from its own last value.

    Vertically it rises to the apex in the fraction `lift` of the time. Then it comes down, and goes
    on at the landing speed where the ground is late.
    """

    reference: Annotated[np.ndarray, 3, 3]  # position, velocity, acceleration [m, s]
    foothold: Annotated[np.ndarray, 2]  # [m]
    time: Mutable[float]  # since lift-off [s]
    duration: Mutable[float]  # from lift-off to touchdown [s]
    ground: Mutable[float]  # height of the ground [m]
    time_offset: Mutable[float]  # part of the duration that feedback and a policy added [s]
    apex: float  # height of the way above the ground [m]
    lift: float  # fraction of the duration in which the foot rises
    landing_speed: float  # [m/s]


@compiled
def quintic(
    p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, duration: float, t: float
) -> tuple[float, float, float]:
    """Position, velocity, acceleration at `t` of the polynomial of degree five that leads from
    (p0, v0, a0) to (p1, v1, a1) in `duration`: the way of least jerk [Flash85]."""
    T = max(duration, 1e-6)
    v0, a0, v1, a1 = v0 * T, a0 * T * T, v1 * T, a1 * T * T
    d = p1 - p0
    c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * d - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    s = min(max(t / T, 0.0), 1.0)
    position = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    velocity = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    acceleration = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    return position, velocity / T, acceleration / (T * T)


@compiled
def start_swing(w: Swing, point: np.ndarray, ground: float, duration: float) -> None:
    """Begin a swing of `duration` [s] at rest at `point` (3,) [m], above `ground` [m]."""
    for a in range(3):
        w.reference[0, a], w.reference[1, a], w.reference[2, a] = point[a], 0.0, 0.0
    w.foothold[0], w.foothold[1] = point[0], point[1]
    w.time, w.duration, w.ground, w.time_offset = 0.0, duration, ground, 0.0


@compiled
def time_left(w: Swing) -> float:
    """The time until touchdown is planned [s]."""
    return max(w.duration - w.time, 0.0)


@compiled
def aim_swing(w: Swing, x: float, y: float, duration: float) -> None:
    """Lead to the foothold (x, y) [m] in `duration` [s]; nothing in the last `FROZEN` seconds."""
    if time_left(w) > FROZEN:
        w.foothold[0], w.foothold[1] = x, y
        w.duration = max(duration, w.time + FROZEN)


@compiled
def _lead(
    reference: np.ndarray, a: int, position: float, velocity: float, duration: float, dt: float
) -> None:
    """Move axis `a` of the reference `dt` further on its way to a place and a speed."""
    reference[0, a], reference[1, a], reference[2, a] = quintic(
        reference[0, a], reference[1, a], reference[2, a], position, velocity, 0.0, duration, dt
    )


@compiled
def advance_over(w: Swing, apex: float, dt: float) -> None:
    """Go `dt` [s] further: up to an `apex` above the ground [m], down to it, on at the landing
    speed."""
    rest, now, ground, speed = time_left(w), w.reference, w.ground, w.landing_speed
    for a in range(2):
        if rest > dt:
            _lead(now, a, w.foothold[a], 0.0, rest, dt)
        else:
            now[0, a], now[1, a], now[2, a] = w.foothold[a], 0.0, 0.0
    lift = w.lift * w.duration
    if w.time + dt < lift:
        _lead(now, 2, ground + apex, 0.0, lift - w.time, dt)
    elif rest > dt:
        _lead(now, 2, ground, -speed, rest, dt)
    else:
        now[0, 2], now[1, 2], now[2, 2] = now[0, 2] - speed * dt, -speed, 0.0
    w.time += dt


@compiled
def advance_high(w: Swing, top: float, lower: float, dt: float) -> None:
    """The same over rough ground: up to a height `top` [m] at `lift`, and on at it until the
    fraction `lower`: the foot is high before it is far, and comes down where it is to land."""
    start, now = w.time, w.reference
    z, speed, accel = now[0, 2], now[1, 2], now[2, 2]
    advance_over(w, top - w.ground, dt)
    end = lower * w.duration
    if w.lift * w.duration <= w.time < end:
        now[0, 2], now[1, 2], now[2, 2] = quintic(z, speed, accel, top, 0.0, 0.0, end - start, dt)


def swing_at(point: np.ndarray, duration: float, task: SwingTask, units: Units) -> Swing:
    """The swing of a foot at rest at `point` (3,) [m], of `duration` [s]."""
    numbers, apex = in_si(task, units, "lift", "landing_speed"), task.clearance * units.height
    swing = Swing.allocate(**numbers, apex=apex)
    start_swing(swing, np.array(point, dtype=float), float(point[2]), float(duration))
    return swing
