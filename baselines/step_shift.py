"""What a policy adds to a stepping controller's choices, and what it is told of the step.

A controller with a `shift` and a method `stepping` can be used by `residual_step_env.py`.
"""

from dataclasses import dataclass, field, fields
from typing import NamedTuple

import numpy as np


def _pair() -> np.ndarray:
    return np.zeros(2)


@dataclass
class StepShift:
    """Added to a stepping controller's own choices; axes of the step's heading. Zero: nothing."""

    com: np.ndarray = field(default_factory=_pair)  # where the capture point is to rest [m]
    cop: np.ndarray = field(default_factory=_pair)  # the CoP [m]
    height: float = 0.0  # of the CoM [m]
    lean: np.ndarray = field(default_factory=_pair)  # of the root, about x and y [rad]
    foothold: np.ndarray = field(default_factory=_pair)  # [m]
    time: float = 0.0  # from lift-off to touchdown [s]
    trigger: float = 0.0  # how much further the capture point may leave before a step [m]

    def clear(self) -> None:
        """As before the first tick."""
        for item in fields(self):
            setattr(self, item.name, 0.0 * getattr(self, item.name))


class Stepping(NamedTuple):
    """Where a stepping controller is in its steps."""

    steps: int  #: begun since the reset
    foot: int  #: that swings; −1: none
    point: np.ndarray  #: (3,) where its sole is meant to be now [m]
    foothold: np.ndarray  #: (2,) where it is to land [m]
    phase: float  #: share of the swing that is over
    remaining: float  #: until touchdown [s]
    since: float  #: since the last touchdown [s]


STANDING = Stepping(0, -1, np.zeros(3), np.zeros(2), 0.0, 0.0, 0.0)


def lean_matrix(lean: np.ndarray) -> np.ndarray:
    """(3, 3) turn by the rotation vector (lean_x, lean_y, 0): Rodrigues' formula."""
    angle = float(np.hypot(lean[0], lean[1]))
    if angle == 0.0:
        return np.eye(3)
    x, y = lean / angle
    K = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)
