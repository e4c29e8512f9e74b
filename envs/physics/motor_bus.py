"""Data between computer and motors: joint readings, torques, targets and gains."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable


@dataclass(eq=False)
class MotorBus(Block):
    """The readings of the motors' encoders, and what the motors are asked for where servos run.

    Where motors are ideal all arrays are empty: servos go by the true joints, and act at once.
    """

    q: Annotated[np.ndarray, "nj"]  # joint positions that the motors read now [rad]
    dq: Annotated[np.ndarray, "nj"]  # joint velocities, also read now [rad/s]
    servoed: Mutable[int]  # 1 where motors are asked for what follows
    torque: Annotated[np.ndarray, "nu"]  # u [N·m] of τ = u + K (q* − q) − D q̇
    target: Annotated[np.ndarray, "nu"]  # q* [rad]
    stiffness: Annotated[np.ndarray, "nu"]  # K [N·m/rad]
    damping: Annotated[np.ndarray, "nu"]  # D [N·m·s/rad]


def ideal_bus() -> MotorBus:
    """Return the bus of ideal motors: it is empty."""
    return MotorBus.allocate({"nj": 0, "nu": 0})


@compiled
def ask_servo(
    bus: MotorBus, i: int, torque: float, target: float, stiffness: float, damping: float
):
    """Ask motor i for τ = `torque` + `stiffness` (`target` − q) − `damping` q̇."""
    bus.torque[i], bus.target[i] = torque, target
    bus.stiffness[i], bus.damping[i] = stiffness, damping
    bus.servoed = 1
