"""The two sides of a join, and what came of joining them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .check import Feasibility
from .curve import Boundary, Curve

CALM = 1e-9  # [m/s², rad/s²] below which an acceleration is the rounding of a posture that is held


class End(NamedTuple):
    """One side of a join: joints of its frames (m, nj) and the state next to the join."""

    frames: np.ndarray
    q: np.ndarray
    boundary: Boundary
    region: np.ndarray  # (k, 2) where the motors can bear the weight
    own: Feasibility  # of the motion about the join, whether it is played or not

    @property
    def is_calm(self) -> bool:
        """Whether it has no acceleration, so that `calm` is no other end."""
        return bool(np.abs(self.boundary.acceleration).max() < CALM)

    @property
    def calm(self) -> End:
        """The same place and rate without acceleration."""
        none = np.zeros_like(self.boundary.acceleration)
        return self._replace(boundary=self.boundary._replace(acceleration=none))


class Attempt(NamedTuple):
    """What came of one duration.

    Attributes:
        qpos: (n − 1, nq) of the frames between both ends; None if it is not possible.
        curve: that they follow.
        feasibility: of the way from end to end; None if legs cannot reach the ground at all.
        reason: why it is not possible.
    """

    qpos: np.ndarray | None
    curve: Curve
    feasibility: Feasibility | None
    reason: str

    @property
    def lacking(self) -> float:
        """How far it is from possible, see `Feasibility`."""
        return np.inf if self.feasibility is None else self.feasibility.lacking
