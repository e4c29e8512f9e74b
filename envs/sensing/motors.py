"""Motors: what comes of the torques that are asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.simulation import Simulation

from .drawn import DrawnRobot

RING = 64  # physics steps that are remembered
BLEND, NO_LOAD = range(2)  # entries of `Motors.numbers`


@dataclass(frozen=True, eq=False)
class Motors(Block):
    """The motors of an episode's robot (nu)."""

    robot: RobotArrays
    views: SimViews
    asked: np.ndarray  # (RING, nu) torques that were asked for [N·m]
    next: np.ndarray  # (1,) int: the row of the next ones
    late: np.ndarray  # (1,) int: physics steps
    torque: np.ndarray  # (nu,) that act [N·m]
    gain: np.ndarray  # (nu,)
    numbers: np.ndarray  # (2,) 1 − exp(−dt/lag); the no-load speed [rad/s], 0: none


def allocate_motors(simulation: Simulation) -> Motors:
    """Motors that have been asked for nothing."""
    nu = simulation.model.nu
    return Motors(
        robot=simulation.arrays,
        views=simulation.views,
        asked=guarded_zeros((RING, nu)),
        next=guarded_zeros(1, dtype=np.int64),
        late=guarded_zeros(1, dtype=np.int64),
        torque=guarded_zeros(nu),
        gain=guarded_zeros(nu),
        numbers=guarded_zeros(2),
    )


def begin_motors(m: Motors, drawn: DrawnRobot, holding: np.ndarray) -> None:
    """Start an episode, before which torques `holding` (nu,) [N·m] were asked for all the time."""
    m.asked[:], m.torque[:], m.gain[:] = holding, drawn.gain * holding, drawn.gain
    m.next[0], m.late[0] = 0, drawn.command
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

    The motor i is asked for u = ctrl of `late` physics steps ago, and follows it as

        τ ← τ + (1 − exp(−dt/lag)) (gain · u − τ),    |τ| ≤ τ_max · fraction_at(q̇)

    `views.ctrl` stays what is asked for: the difference is a generalised force.
    """
    k, n = m.next[0], m.asked.shape[0]
    m.next[0] = (k + 1) % n
    then = (k - m.late[0] + n) % n
    for i in range(m.torque.shape[0]):
        dof = m.robot.motor_dofs[i]
        m.asked[k, i] = m.views.ctrl[i]
        torque = m.torque[i]
        torque += m.numbers[BLEND] * (m.gain[i] * m.asked[then, i] - torque)
        limit = m.robot.torque_limit[i] * fraction_at(m.views.qvel[dof], torque, m.numbers[NO_LOAD])
        m.torque[i] = min(max(torque, -limit), limit)
        m.views.qfrc_applied[dof] = m.torque[i] - m.views.ctrl[i]
