"""Which soles bear a robot in the frames of a clip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Support(NamedTuple):
    """The contacts of F frames.

    Attributes:
        planted: (F, 2) bool, which of the robot's soles are on the ground.
        home: (F,) bool, whether both are, and stand to each other as in the standing posture.
    """

    planted: np.ndarray
    home: np.ndarray

    @classmethod
    def both(cls, frames: int) -> Support:
        """Both soles where the robot stands, always."""
        return cls(np.ones((frames, 2), dtype=bool), np.ones(frames, dtype=bool))

    @classmethod
    def together(cls, parts: Sequence[Support]) -> Support:
        """One after the other."""
        planted, home = zip(*parts, strict=True)
        return cls(np.concatenate(planted), np.concatenate(home))

    def at(self, frames: slice | np.ndarray) -> Support:
        """That of some frames."""
        return Support(self.planted[frames], self.home[frames])

    def mirrored(self) -> Support:
        """Left and right exchanged."""
        return Support(self.planted[:, ::-1], self.home)

    def run(self, frame: int) -> slice:
        """The frames about one without a step between; empty where the feet are not home."""
        away = np.flatnonzero(~self.home)
        after = int(np.searchsorted(away, frame))
        first = int(away[after - 1]) + 1 if after else 0
        last = int(away[after]) if after < len(away) else len(self.home)
        return slice(first, last)
