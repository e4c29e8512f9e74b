"""Motors: what comes of the torques that are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.motor_bus import MotorBus

from .drawn import DrawnRobot

RING = 64  # physics steps that are remembered
TORQUE, TARGET, STIFFNESS, DAMPING = range(4)  # rows of `Motors.asked`
BLEND, NO_LOAD = range(2)  # entries of `Motors.numbers`


@dataclass(frozen=True, eq=False)
class Motors(Block):
    """The motors of an episode's robot (nu)."""

    robot: RobotArrays
    views: SimViews
    bus: MotorBus
    asked: Annotated[np.ndarray, RING, 4, "nu"]  # asked for: torque, target, stiffness, damping
    written: Annotated[np.ndarray, 1, np.int64]  # rows since the reset; the next one follows
    late: Annotated[np.ndarray, 1, np.int64]  # physics steps
    torque: Annotated[np.ndarray, "nu"]  # that act [N·m]
    gain: Annotated[np.ndarray, "nu"]
    numbers: Annotated[np.ndarray, 2]  # 1 − exp(−dt/lag); the no-load speed [rad/s], 0: none


def begin_motors(m: Motors, drawn: DrawnRobot, holding: np.ndarray) -> None:
    """Start an episode, before which torques `holding` (nu,) [N·m] were asked for all the time."""
    m.asked[:], m.torque[:], m.gain[:] = 0.0, drawn.gain * holding, drawn.gain
    m.asked[:, TORQUE], m.bus.servoed[0] = holding, 0
    m.written[0], m.late[0] = 0, drawn.command
    m.numbers[BLEND] = -np.expm1(-m.robot.timestep / drawn.lag) if drawn.lag > 0.0 else 1.0
    m.numbers[NO_LOAD] = drawn.no_load_speed


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
    k, n = m.written[0], m.asked.shape[0]
    m.written[0] += 1
    remember(m, m.asked[k % n])
    then = m.asked[(k - m.late[0]) % n]
    for i in range(m.torque.shape[0]):
        dof = m.robot.motor_dofs[i]
        asked = then[TORQUE, i]
        if then[STIFFNESS, i] != 0.0 or then[DAMPING, i] != 0.0:
            asked += then[STIFFNESS, i] * (then[TARGET, i] - m.bus.q[dof - 6])
            asked -= then[DAMPING, i] * m.bus.dq[dof - 6]
        most = m.robot.torque_limit[i]
        asked = m.gain[i] * min(max(asked, -most), most)
        torque = m.torque[i]
        torque += m.numbers[BLEND] * (asked - torque)
        limit = most * fraction_at(m.views.qvel[dof], torque, m.numbers[NO_LOAD])
        m.torque[i] = min(max(torque, -limit), limit)
        m.views.qfrc_applied[dof] = m.torque[i] - m.views.ctrl[i]


@compiled
def remember(m: Motors, row: np.ndarray):
    """Write what the motors are asked for now into `row` (4, nu)."""
    servoed, bus = m.bus.servoed[0], m.bus
    for i in range(row.shape[1]):
        row[TORQUE, i] = bus.torque[i] if servoed else m.views.ctrl[i]
        row[TARGET, i] = bus.target[i] if servoed else 0.0
        row[STIFFNESS, i] = bus.stiffness[i] if servoed else 0.0
        row[DAMPING, i] = bus.damping[i] if servoed else 0.0
