"""Motors: what comes of the torques that are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.motor_bus import MotorBus

from .drawn import DrawnRobot

RING = 64  # physics steps that are remembered


@dataclass(frozen=True, eq=False)
class MotorHistory(Block):
    """What motors were asked for in the last `RING` physics steps, see `ask_servo`."""

    torque: Annotated[np.ndarray, RING, "nu"]  # u [N·m]
    target: Annotated[np.ndarray, RING, "nu"]  # q* [rad]
    stiffness: Annotated[np.ndarray, RING, "nu"]  # K [N·m/rad]
    damping: Annotated[np.ndarray, RING, "nu"]  # D [N·m·s/rad]


@dataclass(eq=False)
class Motors(Block):
    """The motors of an episode's robot (nu)."""

    robot: RobotArrays
    views: SimViews
    bus: MotorBus
    asked: MotorHistory
    written: Mutable[int]  # rows since the reset; the next one follows
    late: Mutable[int]  # physics steps
    torque: Annotated[np.ndarray, "nu"]  # that act [N·m]
    gain: Annotated[np.ndarray, "nu"]
    blend: Mutable[float]  # 1 − exp(−dt/lag)
    no_load: Mutable[float]  # speed [rad/s]; 0: none


def begin_motors(m: Motors, drawn: DrawnRobot, holding: np.ndarray) -> None:
    """Start an episode, before which torques `holding` (nu,) [N·m] were asked for all the time."""
    m.asked.clear()
    m.torque[:], m.gain[:] = drawn.gain * holding, drawn.gain
    m.asked.torque[:], m.bus.servoed = holding, 0
    m.written, m.late = 0, drawn.command
    m.blend = -np.expm1(-m.robot.timestep / drawn.lag) if drawn.lag > 0.0 else 1.0
    m.no_load = drawn.no_load_speed


@compiled
def fraction_at(speed: float, torque: float, no_load: float) -> float:
    """Return the fraction of its limit that a motor has at `speed` [rad/s].

    It is 1 up to half of the no-load speed, and falls linearly to 0 there; a motor that brakes has
    all of it.
    """
    if no_load == 0.0 or speed * torque <= 0.0:
        return 1.0
    return min(max(2.0 - 2.0 * abs(speed) / no_load, 0.0), 1.0)


@compiled
def drive_motors(m: Motors):
    """Apply the torques that the motors have now, in addition to what `views.ctrl` does.

    A motor is asked for u, q*, K, D; a torque alone is u = ctrl. It has them `late` physics steps
    later, and its own encoder at once:

        τ ← τ + (1 − exp(−dt/lag)) (gain (u + K (q* − q) − D q̇) − τ)
        |τ| ≤ τ_max · fraction_at(q̇)

    `views.ctrl` stays the command: the difference is a generalised force.
    """
    k, a = m.written, m.asked
    m.written += 1
    remember(m, k % RING)
    then = (k - m.late) % RING
    for i in range(m.torque.shape[0]):
        dof = m.robot.motor_dofs[i]
        asked = a.torque[then, i]
        if a.stiffness[then, i] != 0.0 or a.damping[then, i] != 0.0:
            asked += a.stiffness[then, i] * (a.target[then, i] - m.bus.q[dof - 6])
            asked -= a.damping[then, i] * m.bus.dq[dof - 6]
        most = m.robot.torque_limit[i]
        asked = m.gain[i] * min(max(asked, -most), most)
        torque = m.torque[i]
        torque += m.blend * (asked - torque)
        limit = most * fraction_at(m.views.qvel[dof], torque, m.no_load)
        m.torque[i] = min(max(torque, -limit), limit)
        m.views.qfrc_applied[dof] = m.torque[i] - m.views.ctrl[i]


@compiled
def remember(m: Motors, row: int):
    """Write what the motors are asked for now into a row of `asked`."""
    servoed, bus, a = m.bus.servoed, m.bus, m.asked
    for i in range(m.torque.shape[0]):
        a.torque[row, i] = bus.torque[i] if servoed else m.views.ctrl[i]
        a.target[row, i] = bus.target[i] if servoed else 0.0
        a.stiffness[row, i] = bus.stiffness[i] if servoed else 0.0
        a.damping[row, i] = bus.damping[i] if servoed else 0.0
