"""The first-order pendulum: a leg of one length, on which the hip goes along an arc."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .legs import measure_legs
from .reference import Reference, ReferenceModel, add_height, clear_answers, way_of
from .two_rods import height_over, length_at


@dataclass(frozen=True, eq=False)
class RigidTick(Block):
    """What a tick of `Rigid` works on."""

    state: StateArrays
    reference: Reference
    length: float  # ℓ [m]


@compiled
def rigid_tick(t: RigidTick) -> None:
    """Answer with the arcs of both legs."""
    r = t.reference
    measure_legs(t.state, r.legs)
    clear_answers(r)
    for leg in range(2):
        if r.share[0, leg] > 0.0:
            way, rate, accel = way_of(r, leg)
            z, rise, fall = height_over(t.length, 0.0, 0.0, way, rate, accel)
            add_height(r, leg, z, rise, fall)


@dataclass(frozen=True)
class Rigid(ReferenceModel):
    """z = √(ℓ² − d²), d the horizontal distance of the hip from the ankle [Zhao, fig. 2a].

    ż = −d ḋ/z and z̈ = −(ḋ² + d d̈ + ż²)/z, with d̈ from the horizontal balance. ℓ is the length of a
    leg whose knee is bent by `flexion`, which it keeps from touchdown on.
    """

    kind: Literal["rigid"] = "rigid"
    flexion: float = field(default=12.0, metadata={"min": 0.0, "max": 90.0})  # of the knee [°]

    def bind(self, robot: Robot, state: StateArrays, reference: Reference) -> Program:
        """The arc of this robot's legs."""
        legs = reference.legs
        length = length_at(legs.thigh, legs.shank, np.radians(self.flexion))
        return Program.of([(rigid_tick, RigidTick(state, reference, float(length)))])
