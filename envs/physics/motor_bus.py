"""What a computer and the motors tell each other: joint readings, torques, targets and gains."""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros


@dataclass(frozen=True, eq=False)
class MotorBus(Block):
    """The readings of the motors' encoders, and what the motors are asked for where servos run.

    Where motors are ideal all arrays are empty: servos go by the true joints, and act at once.
    """

    q: np.ndarray  # (nj,) joint positions that the motors read now [rad]
    dq: np.ndarray  # (nj,) joint velocities likewise [rad/s]
    servoed: np.ndarray  # (1,) int: 1 where the motors are asked for what follows, once
    torque: np.ndarray  # (nu,) u [N·m] of τ = u + K (q* − q) − D q̇
    target: np.ndarray  # (nu,) q* [rad]
    stiffness: np.ndarray  # (nu,) K [N·m/rad]
    damping: np.ndarray  # (nu,) D [N·m·s/rad]


def motor_bus(nj: int = 0, nu: int = 0) -> MotorBus:
    """The bus of a robot of `nj` joints and `nu` motors; of none where motors are ideal."""
    zeros = guarded_zeros
    whole = zeros(1, dtype=np.int64)
    return MotorBus(zeros(nj), zeros(nj), whole, zeros(nu), zeros(nu), zeros(nu), zeros(nu))


@compiled
def ask_servo(
    bus: MotorBus, i: int, torque: float, target: float, stiffness: float, damping: float
):
    """Ask motor i for τ = `torque` + `stiffness` (`target` − q) − `damping` q̇."""
    bus.torque[i], bus.target[i] = torque, target
    bus.stiffness[i], bus.damping[i] = stiffness, damping
    bus.servoed[0] = 1
