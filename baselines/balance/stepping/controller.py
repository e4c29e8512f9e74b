"""The interface of a controller that steps: offsets to its choices, and the step in progress."""

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references import targets
from poise.baselines.controller import BaseController
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import guarded_zeros

from .planning.config import StepLimits


def _offset(first: int, count: int, doc: str) -> property:
    """Entries of `StepOffsets.values`; of one alone the number."""
    own = slice(first, first + count)

    def get(offsets: "StepOffsets") -> np.ndarray | float:
        return offsets.values[own] if count > 1 else float(offsets.values[first])

    def put(offsets: "StepOffsets", value: np.ndarray | float) -> None:
        offsets.values[own] = value

    return property(get, put, doc=doc)


class StepOffsets(Copyable):
    """The offsets that a policy adds to a stepping controller's choices, in axes of the heading.

    Zeros add nothing. The order of `values` is that of `NAMES` in `references/targets.py`.
    """

    com = _offset(targets.COM_X, 2, "(2,) The place where the capture point is to rest [m].")
    cop = _offset(targets.COP_X, 2, "(2,) The CoP [m].")
    height = _offset(targets.COM_Z, 1, "The height of the CoM [m].")
    lean = _offset(targets.LEAN_X, 2, "(2,) The lean of the root about x and y [rad].")
    foothold = _offset(targets.FOOTHOLD_X, 2, "(2,) The foothold [m].")
    time = _offset(targets.TIME, 1, "The time from lift-off to touchdown [s].")
    trigger = _offset(
        targets.TRIGGER, 1, "How much further the capture point may leave before a step [m]."
    )

    def __init__(self) -> None:
        self.values = guarded_zeros(len(targets.NAMES))  #: (13,) all of them, for compiled code

    def clear(self) -> None:
        """Set all to zero."""
        self.values[:] = 0.0


class Stepping(NamedTuple):
    """The step that a controller is in."""

    steps: int  #: steps begun since the reset
    foot: int  #: the foot that swings; −1: none
    point: np.ndarray  #: (3,) where its sole is meant to be now [m]
    foothold: np.ndarray  #: (2,) where it is to land [m]
    phase: float  #: fraction of the swing that is over
    remaining: float  #: time until touchdown [s]
    since: float  #: time since the last touchdown [s]

    def entries(self) -> list[float]:
        """(7,) numbers, in the order in which the terms about steps read them."""
        x, y = self.foothold
        return [self.steps, self.foot, x, y, self.phase, self.remaining, self.since]


STANDING = Stepping(0, -1, np.zeros(3), np.zeros(2), 0.0, 0.0, 0.0)


class SteppingController(BaseController):
    """A controller that decides where its feet go, and lets a policy move what it decides."""

    offsets: StepOffsets  #: added to its own choices

    def stepping(self) -> Stepping:
        """The step in progress, see `Stepping`."""
        raise NotImplementedError

    @property
    def step_limits(self) -> StepLimits | None:
        """The limits of the controller's steps, or None if it has none."""
        return None
