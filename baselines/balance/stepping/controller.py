"""The interface of a controller that steps: offsets to its choices, and the step in progress."""

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.targets import Offsets
from poise.baselines.controller import BaseController

from .planning.config import StepLimits


class Stepping(NamedTuple):
    """The step that a controller is in."""

    steps: int  #: steps begun since the reset
    foot: int  #: the foot that swings; −1: none
    point: np.ndarray  #: (3,) where its sole is meant to be now [m]
    foothold: np.ndarray  #: (2,) where it is to land [m]
    phase: float  #: fraction of the swing that is over
    remaining: float  #: time until touchdown [s]
    since: float  #: time since the last touchdown [s]


STANDING = Stepping(0, -1, np.zeros(3), np.zeros(2), 0.0, 0.0, 0.0)


class SteppingController(BaseController):
    """A controller that decides where its feet go, and lets a policy move what it decides."""

    offsets: Offsets  #: added to its own choices

    def stepping(self) -> Stepping:
        """The step in progress, see `Stepping`."""
        raise NotImplementedError

    @property
    def step_limits(self) -> StepLimits | None:
        """The limits of the controller's steps, or None if it has none."""
        return None
