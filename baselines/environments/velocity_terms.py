"""The commanded velocity as a policy observes it, and how far the robot is from it."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.walking.calibration import (
    CalibrationArrays,
    observed_ahead,
    observed_left,
    observed_turn,
)
from poise.baselines.walking.correction import turn_rate
from poise.envs.balance.mdp.observation import GROUND, Terms, View
from poise.envs.balance.mdp.terms import TERMS
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along
from poise.envs.physics.kinematics import StateArrays


@dataclass(frozen=True, eq=False)
class CommandView(Block):
    """The block of a term of the command: what it reads, and the place that it fills."""

    seen: View
    command: np.ndarray  # (8,) see `GaitCommand.array`
    error: np.ndarray  # (3,) see `Course`
    calibration: CalibrationArrays
    shift: np.ndarray  # (3,) of a `Correction`
    way: np.ndarray  # (2,) of an `Admittance`
    evasion: np.ndarray  # (3,) of an `Evasion`


@compiled
def stands_still(t: CommandView) -> bool:
    """Whether the robot has to begin to walk, see `Calibration`."""
    rates = t.seen.state.qvel[6:]
    return np.sqrt(np.mean(rates * rates)) < t.calibration.still


VELOCITY_TERMS = Terms(TERMS, CommandView)  #: by name; those of every environment first


@VELOCITY_TERMS.add(GROUND, "0.2 ω h", "commanded velocity, ahead and to the left", "vector")
def command_velocity(t: CommandView):
    seen, unit, still = t.seen, t.seen.scales.velocity, stands_still(t)
    ahead = observed_ahead(t.calibration, t.command, still, t.shift[0], t.way[0])
    left = observed_left(t.calibration, t.command, still, t.shift[1], t.way[1])
    seen.out[0] = (ahead + t.evasion[0]) / unit
    seen.out[1] = (left + t.evasion[1]) / unit


@VELOCITY_TERMS.add(("z",), "0.2 ω", "commanded turning rate, to the left", "turn")
def command_turn(t: CommandView):
    seen = t.seen
    turn = observed_turn(t.calibration, t.command, stands_still(t), t.shift[2])
    turn += t.evasion[2]
    seen.out[0] = turn / (0.2 * seen.scales.omega)


@VELOCITY_TERMS.add(
    GROUND, "0.2 ω h", "true mean velocity of the last strides minus the command", "vector",
    default=False,
)  # fmt: skip
def velocity_error(t: CommandView):
    seen = t.seen
    for a in range(2):
        seen.out[a] = t.error[a] / seen.scales.velocity


@VELOCITY_TERMS.add(
    ("z",), "0.2 ω", "true mean turning rate of the last strides minus the command", "turn",
    default=False,
)  # fmt: skip
def turn_error(t: CommandView):
    seen = t.seen
    seen.out[0] = t.error[2] / (0.2 * seen.scales.omega)


@dataclass(frozen=True, eq=False)
class Course(Block):
    """The velocity of the robot, low-passed, and how far it is from the command."""

    state: StateArrays  # the true one
    command: np.ndarray  # (8,) see `GaitCommand.array`
    mean: Annotated[np.ndarray, 3]  # of the CoM ahead, left [m/s], of the turning rate [rad/s]
    error: Annotated[np.ndarray, 3]  # mean − command
    part: float  # 1 − exp(−T / `MEAN_TIME`), T the policy step


@compiled
def follow_course(c: Course):
    """Take in a policy step: mean ← mean + part (v − mean), in the heading frame."""
    s, part = c.state, c.part
    ahead, left = along(s.heading[0], s.heading[1], s.com_vel[0], s.com_vel[1])
    c.mean[0] += part * (ahead - c.mean[0])
    c.mean[1] += part * (left - c.mean[1])
    c.mean[2] += part * (turn_rate(s) - c.mean[2])
    for a in range(3):
        c.error[a] = c.mean[a] - c.command[a]
