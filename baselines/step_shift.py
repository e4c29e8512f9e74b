"""What a policy adds to a stepping controller's choices, and what it is told of the step.

A controller with a `shift` and a method `stepping` can be used by `residual_step_env.py`.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from poise.envs.block import Block
from poise.envs.copies import Copyable
from poise.envs.jit import compiled
from poise.envs.kinematics import StateArrays
from poise.envs.memory import apart

# entries of `StepShift.values`: the order of `StepScales.entries`
COM, COP, HEIGHT, LEAN, FOOTHOLD, TIME, TRIGGER = 0, 2, 4, 5, 9, 11, 12
SHIFTS = 13


def _entry(first: int, doc: str) -> property:
    def get(shift: "StepShift") -> float:
        return float(shift.values[first])

    def put(shift: "StepShift", value: float) -> None:
        shift.values[first] = value

    return property(get, put, doc=doc)


def _pair(first: int, doc: str) -> property:
    def get(shift: "StepShift") -> np.ndarray:
        return shift.values[first : first + 2]

    def put(shift: "StepShift", value: np.ndarray) -> None:
        shift.values[first : first + 2] = value

    return property(get, put, doc=doc)


class StepShift(Copyable):
    """Added to a stepping controller's own choices; axes of the step's heading. Zero: nothing."""

    com = _pair(COM, "(2,) where the capture point is to rest [m]")
    cop = _pair(COP, "(2,) the CoP [m]")
    height = _entry(HEIGHT, "of the CoM [m]")
    lean = _pair(LEAN, "(2,) of the root, about x and y [rad]")
    foothold = _pair(FOOTHOLD, "(2,) [m]")
    time = _entry(TIME, "from lift-off to touchdown [s]")
    trigger = _entry(TRIGGER, "how much further the capture point may leave before a step [m]")

    def __init__(self) -> None:
        self.values = apart(SHIFTS)  #: all of them, for compiled code

    def clear(self) -> None:
        """As before the first tick."""
        self.values[:] = 0.0


class Stepping(NamedTuple):
    """Where a stepping controller is in its steps."""

    steps: int  #: begun since the reset
    foot: int  #: that swings; −1: none
    point: np.ndarray  #: (3,) where its sole is meant to be now [m]
    foothold: np.ndarray  #: (2,) where it is to land [m]
    phase: float  #: share of the swing that is over
    remaining: float  #: until touchdown [s]
    since: float  #: since the last touchdown [s]

    def told(self) -> list[float]:
        """(7,) for `observe_step`."""
        x, y = self.foothold
        return [self.steps, self.foot, x, y, self.phase, self.remaining, self.since]


STANDING = Stepping(0, -1, np.zeros(3), np.zeros(2), 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class StepSight(Block):
    """What a policy sees of the steps."""

    state: StateArrays
    told: np.ndarray  # (7,) `Stepping.told`
    height: float  # h [m]
    omega: float  # [1/s]
    observation: np.ndarray  # (≥ 15,) of which the last are filled


@compiled
def _put_local(sight: StepSight, first: int, x: float, y: float):
    """(x, y) in the heading frame, in 0.5 h."""
    cos, sin, half = sight.state.heading[0], sight.state.heading[1], 0.5 * sight.height
    sight.observation[first] = (cos * x + sin * y) / half
    sight.observation[first + 1] = (cos * y - sin * x) / half


@compiled
def observe_step(sight: StepSight):
    """The terms `swing` to `stance_capture_point` of `ResidualStepEnv`, clipped to ±10."""
    s, told, out = sight.state, sight.told, sight.observation
    first, foot, feet = out.shape[0] - 15, int(told[1]), s.sole_point
    for i in range(2):
        out[first + i] = 1.0 if foot == i else 0.0
    out[first + 2], out[first + 5] = told[4], told[0]
    out[first + 3], out[first + 4] = sight.omega * told[5], sight.omega * told[6]
    _put_local(sight, first + 6, feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1])
    for i in range(first + 8, first + 15):
        out[i] = 0.0
    if foot >= 0:
        stance, moving, xi = feet[1 - foot], feet[foot], s.capture_point
        _put_local(sight, first + 8, moving[0] - stance[0], moving[1] - stance[1])
        out[first + 10] = (moving[2] - stance[2]) / (0.5 * sight.height)
        _put_local(sight, first + 11, told[2] - stance[0], told[3] - stance[1])
        _put_local(sight, first + 13, xi[0] - stance[0], xi[1] - stance[1])
    for i in range(first, first + 15):
        out[i] = min(max(out[i], -10.0), 10.0)
