"""The linear inverted pendulum: the CoM's height is constant."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from poise.envs.compiled.calls import Program
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .reference import Reference, ReferenceModel


@dataclass(frozen=True)
class Lip(ReferenceModel):
    """z = z₀, the gait's `height`, or what its `leg_length` reaches in a long step.

    Then c̈ = ω² (c − p) with ω² = g/z₀ exactly: what `dcm.py` plans with. Knees stay bent by what
    the longest step needs.
    """

    keeps_height: ClassVar[bool] = True

    kind: Literal["lip"] = "lip"

    def bind(self, robot: Robot, state: StateArrays, reference: Reference) -> Program:
        """Nothing: the walk's own tick keeps the height."""
        return Program.of(())
