"""The second-order pendulum of [Zhao]: thigh and shank, with a knee that bears nothing if it can.

A point mass m at the hip, massless rods; N the force of the leg on the mass. With a free knee the
force goes along the thigh [Zhao (4), (5) with τ_φ = 0, McGeer]:

    m ẍ = N sin φ,   m z̈ = N cos φ − m g,   so   tan φ = ẍ/(g + z̈) = (x − p)/z,

p the CoP from the ankle: the thigh points from the CoP's line to the hip. With the geometry
x = L2 sin θ + L1 sin φ this gives θ, and the flexion that frees the knee,

    β* = θ − φ,   θ = asin((x − L1 sin φ)/L2).

Near it the knee's torque is τ ≈ N L2 (β − β*), so the least ∫ (β − β*)² + w β̈² dt is what the knee
follows: with a β* that rests, the linear quadratic law

    β̈ = −(β − β*)/√w − √2 β̇/w^¼,

a filter of ω_b = w^−¼ and damping 1/√2, which the reference keeps within the model. β stays
between the least and the largest flexion.
"""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .legs import measure_legs
from .reference import (
    Reference,
    ReferenceModel,
    RowGains,
    RowWeights,
    add_height,
    ask_flexion,
    clear_answers,
    row_gains,
    way_of,
)
from .seed_form import shank_growth, thigh_coupling
from .two_rods import height_over, length_at, length_motion, rod_angles

LEAST_TIME = 0.05  # [s] until touchdown for which the seed's form plans at least


@dataclass(frozen=True, eq=False)
class DoubleTick(Block):
    """What a tick of `Double` works on."""

    state: StateArrays
    reference: Reference
    rows: RowGains
    rate: float  # ω_b [1/s]
    least: float  # β [rad]
    most: float  # [rad]
    seed_form: bool
    flexion: Annotated[np.ndarray, 2, 3]  # β, β̇, β̈ of each leg's reference [rad, s]


@compiled
def free_flexion(thigh: float, shank: float, x: float, z: float, cop: float) -> float:
    """β* [rad], see above: of a hip at (x, z) from the ankle, the CoP at `cop` ahead of it [m].

    Negative where the force would have to bend the knee backwards.
    """
    phi = np.arctan2(x - cop, z)
    sine = (x - thigh * np.sin(phi)) / shank
    return np.arcsin(min(max(sine, -1.0), 1.0)) - phi


@compiled
def follow_flexion(now: np.ndarray, goal: float, rate: float, dt: float) -> None:
    """Move β, β̇, β̈ of `now` (3,) by `dt` [s] on their way to the `goal`, see above.

    The exact solution of the linear quadratic law: with a = `rate`/√2 and e = β − β*,
    e(t) = e^(−a t) (e cos a t + (ė/a + e) sin a t).
    """
    a = rate / np.sqrt(2.0)
    e, slope = now[0] - goal, (now[1] + a * (now[0] - goal)) / a
    decay, cos, sin = np.exp(-a * dt), np.cos(a * dt), np.sin(a * dt)
    value = decay * (e * cos + slope * sin)
    now[1] = -a * value + a * decay * (slope * cos - e * sin)
    now[0] = goal + value
    now[2] = -rate * rate * value - np.sqrt(2.0) * rate * now[1]


@compiled
def double_tick(t: DoubleTick) -> None:
    """Answer with heights and flexions of both legs."""
    r = t.reference
    legs = r.legs
    measure_legs(t.state, legs)
    clear_answers(r)
    for leg in range(2):
        now = t.flexion[leg]
        if r.share[0, leg] <= 0.0 or r.begun == 0:
            now[0] = min(max(legs.flexion[leg], t.least), t.most)
            now[1] = now[2] = 0.0
        if r.share[0, leg] > 0.0:
            if t.seed_form and r.share[0, leg] == 1.0:
                seed_leg(t, leg, now)
            else:
                double_leg(t, leg, now)


@compiled
def double_leg(t: DoubleTick, leg: int, now: np.ndarray) -> None:
    """The answers for one leg."""
    r = t.reference
    legs = r.legs
    x, cop, _ = ahead_of_ankle(r, leg)
    z = legs.hip[leg, 2] - legs.ankle[leg, 2]
    goal = free_flexion(legs.thigh, legs.shank, x, z, cop)
    follow_flexion(now, min(max(goal, t.least), t.most), t.rate, r.period)
    length, speed, accel = length_motion(legs.thigh, legs.shank, now[0], now[1], now[2])
    way, way_rate, way_accel = way_of(r, leg)
    height, rise, fall = height_over(length, speed, accel, way, way_rate, way_accel)
    add_height(r, leg, height, rise, fall)
    ask_flexion(r, leg, t.rows, now[0], now[1], now[2])


@compiled
def ahead_of_ankle(r: Reference, leg: int) -> tuple[float, float, float]:
    """How far the hip, the CoP and the foothold are ahead of a leg's ankle [m]."""
    x = cop = foothold = 0.0
    for a in range(2):
        ankle = r.legs.ankle[leg, a]
        x += r.ahead[a] * (r.legs.hip[leg, a] - ankle)
        cop += r.ahead[a] * (r.cop[a] - ankle)
        foothold += r.ahead[a] * (r.landing[a] - r.legs.sole[leg, a])
    return x, cop, foothold


@compiled
def seed_leg(t: DoubleTick, leg: int, now: np.ndarray) -> None:
    """The answers for the leg that stands alone by the seed's own form, planned from the measured
    angles to those of a hip in the middle between both feet; see `seed_form.py`."""
    r = t.reference
    legs = r.legs
    x, _, foothold = ahead_of_ankle(r, leg)
    z, flexion = legs.hip[leg, 2] - legs.ankle[leg, 2], legs.flexion[leg]
    theta, phi = rod_angles(legs.thigh, legs.shank, flexion, x, z)
    speed = r.ahead[0] * r.com_vel[0] + r.ahead[1] * r.com_vel[1]
    # ẋ = L2 cos θ θ̇ + L1 cos φ φ̇ with θ̇ = φ̇ + β̇
    arm, shin = legs.thigh * np.cos(phi), legs.shank * np.cos(theta)
    phi_rate = (speed - shin * legs.flexion_rate[leg]) / (arm + shin)
    rate, time = phi_rate + legs.flexion_rate[leg], max(r.time_left, LEAST_TIME)
    length = length_at(legs.thigh, legs.shank, t.least)
    half = 0.5 * foothold
    below = np.sqrt(max(length * length - half * half, 0.0))
    theta_end, phi_end = rod_angles(legs.thigh, legs.shank, t.least, half, below)
    growth = shank_growth(theta, rate, theta_end, time)
    coupling = thigh_coupling(theta, rate, growth, phi, phi_rate, phi_end, time)
    theta_acc, phi_acc = growth * growth * theta, coupling * theta
    now[0], now[1], now[2] = flexion, legs.flexion_rate[leg], theta_acc - phi_acc
    rise = -legs.shank * np.sin(theta) * rate - legs.thigh * np.sin(phi) * phi_rate
    fall = -legs.shank * (np.sin(theta) * theta_acc + np.cos(theta) * rate * rate) - legs.thigh * (
        np.sin(phi) * phi_acc + np.cos(phi) * phi_rate * phi_rate
    )
    add_height(r, leg, z, rise, fall)
    ask_flexion(r, leg, t.rows, now[0], now[1], now[2])
    r.hip[leg, 0], r.hip[leg, 1] = phi_acc, t.rows.hip


@dataclass(frozen=True)
class Double(ReferenceModel):
    """The stance knee follows the flexion that frees it of torque [Zhao §5].

    See the top of this file. `rate` is ω_b in ω. With `seed_form` a leg that stands alone follows
    the angles as [Zhao] prints them instead, see `seed_form.py`; then `least_flexion` is that of
    touchdown.
    """

    has_rows: ClassVar[bool] = True

    kind: Literal["double"] = "double"
    least_flexion: float = field(default=6.0, metadata={"min": 0.0, "max": 90.0})  # [°]
    most_flexion: float = field(default=25.0, metadata={"min": 0.0, "max": 120.0})  # [°]
    rate: float = field(default=5.0, metadata={"above": 0.0})  # ω_b [ω]
    rows: RowWeights = field(default_factory=RowWeights)
    seed_form: bool = False

    def __post_init__(self) -> None:
        if self.most_flexion < self.least_flexion:
            raise ValueError(f"most_flexion: must be at least least_flexion, {self.least_flexion}")

    def bind(self, robot: Robot, state: StateArrays, reference: Reference) -> Program:
        """Both legs of this robot."""
        tick = DoubleTick.allocate(
            state=state, reference=reference, rows=row_gains(self.rows, robot.units),
            rate=self.rate * robot.units.omega, least=float(np.radians(self.least_flexion)),
            most=float(np.radians(self.most_flexion)), seed_form=self.seed_form,
        )  # fmt: skip
        return Program.of([(double_tick, tick)])
