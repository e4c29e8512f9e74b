"""What a policy adds to a stepping controller's choices, and where that is in its steps.

A `SteppingController` has both, and can be used by `environments/stepping.py`.
"""

from typing import NamedTuple

import numpy as np

from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import apart

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
