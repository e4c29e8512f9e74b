"""The spring-loaded inverted pendulum: each leg that bears the robot is a spring."""

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
    ask_flexion,
    clear_answers,
    row_gains,
    way_of,
)
from .two_rods import flexion_motion, length_at


@dataclass(frozen=True, eq=False)
class SpringTick(Block):
    """What a tick of `Spring` works on."""

    state: StateArrays
    reference: Reference
    rows: RowGains
    stiffness: float  # k/m [1/s²]
    damping: float  # d/m [1/s]
    length: float  # ℓ₀ [m]
    height: Annotated[np.ndarray, 3]  # z, ż, z̈ of the model's hip [m, s]


@compiled
def spring_force(
    stiffness: float, damping: float, rest: float, length: float, speed: float
) -> float:
    """k (ℓ₀ − r) − d ṙ, which pushes only [the unit of k times m]."""
    return max(stiffness * (rest - length) - damping * speed, 0.0)


@compiled
def vertical_pull(t: SpringTick, leg: int, z: float, rise: float) -> float:
    """The vertical acceleration that a leg's spring gives the mass [m/s²]: its share of it while
    the load goes from one leg to the other."""
    r = t.reference
    way, rate, _ = way_of(r, leg)
    over = z - r.legs.ankle[leg, 2]
    length = np.sqrt(way + over * over)
    speed = (rate + over * rise) / length
    force = spring_force(t.stiffness, t.damping, t.length, length, speed)
    return r.share[0, leg] * force * over / length


@compiled
def spring_tick(t: SpringTick) -> None:
    """Answer with the height of the mass, and the flexion of the leg that has its length."""
    r, now = t.reference, t.height
    legs, dt = r.legs, t.reference.period
    measure_legs(t.state, legs)
    clear_answers(r)
    hip = 0.0
    for leg in range(2):
        hip += r.share[0, leg] * legs.hip[leg, 2]
    if r.begun == 0:
        now[0], now[1] = hip, 0.0
    now[2] = -r.gravity
    for leg in range(2):
        if r.share[0, leg] > 0.0:
            now[2] += vertical_pull(t, leg, now[0], now[1])
    now[1] += dt * now[2]
    now[0] += dt * now[1]
    r.height[0], r.height[1], r.height[2] = now[0] - hip, now[1], now[2]
    for leg in range(2):
        if r.share[0, leg] > 0.0:
            ask_length(t, leg)


@compiled
def ask_length(t: SpringTick, leg: int) -> None:
    """Ask a leg's knee for the flexion of a leg that ends at the model's hip."""
    r, now = t.reference, t.height
    legs = r.legs
    way, rate, accel = way_of(r, leg)
    z = now[0] - legs.ankle[leg, 2]
    length = np.sqrt(way + z * z)
    speed = (rate + z * now[1]) / length
    change = (accel + now[1] * now[1] + z * now[2] - speed * speed) / length
    reach = legs.thigh + legs.shank
    flexion, turn, turn_rate = flexion_motion(
        legs.thigh, legs.shank, min(length, 0.9995 * reach), speed, change
    )
    ask_flexion(r, leg, t.rows, flexion, turn, turn_rate)


@dataclass(frozen=True)
class Spring(ReferenceModel):
    """m r̈ = k (ℓ₀ − r) r̂ − m g, r from the ankle to the hip [Zhao, fig. 2c, after Mordatch et al.].

    The horizontal part is the balance that all models share, so the vertical one is integrated,

        z̈ = Σ w k (ℓ₀ − r)/m · z/r − g,   r² = d² + z²,

    over the legs that bear the robot, w their shares of the load, k the same for both. With one
    leg, the horizontal force along the leg too, and no damper, energy is conserved. Here the CoP
    moves in the sole instead, and a little damping, d = `damping_ratio` · 2 √(k m), lets the height
    settle to the gait's own period. `stiffness` is k ℓ₀/(m g); ℓ₀ has the knee bent by `flexion`.
    """

    has_rows: ClassVar[bool] = True

    kind: Literal["spring"] = "spring"
    stiffness: float = field(default=20.0, metadata={"above": 1.0})  # k ℓ₀/(m g)
    damping_ratio: float = field(default=0.15, metadata={"min": 0.0})
    flexion: float = field(default=5.0, metadata={"min": 0.0, "max": 90.0})  # at ℓ₀ [°]
    rows: RowWeights = field(default_factory=RowWeights)

    def bind(self, robot: Robot, state: StateArrays, reference: Reference) -> Program:
        """The springs of this robot."""
        legs = reference.legs
        length = float(length_at(legs.thigh, legs.shank, np.radians(self.flexion)))
        stiffness = self.stiffness * robot.units.gravity / length
        tick = SpringTick.allocate(
            state=state, reference=reference, rows=row_gains(self.rows, robot.units), length=length,
            stiffness=stiffness, damping=2.0 * self.damping_ratio * float(np.sqrt(stiffness)),
        )  # fmt: skip
        return Program.of([(spring_tick, tick)])
