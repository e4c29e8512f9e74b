"""What a constraint is: rows of the whole clip, begun where the motion is now."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from poise.configs.kinds import OfKind

from .period import Period, frames_of
from .scene import Rows, Scene


@dataclass(frozen=True, kw_only=True)
class Constraint(OfKind):
    """Base of constraints: a subclass is a frozen dataclass with a `kind` to be named by.

    Attributes:
        period: when it holds, see `frames_of`.
        weight: of its violation, beside the others'.
    """

    room: ClassVar[str] = str(__package__)
    unit: ClassVar[str] = "m"  #: of what `violation` says
    tolerance: ClassVar[float] = 1e-3  #: a violation beyond it counts, in that unit

    period: Period = "always"
    weight: float = field(default=1.0, metadata={"above": 0.0})

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """Rows at some frames, in metres or radians; of several frames at the last of them.

        Raises ConfigError for a point that the robot does not have.
        """
        raise NotImplementedError

    def frames(self, scene: Scene) -> np.ndarray:
        """The frames (k,) at which it holds."""
        return frames_of(self.period, scene)

    def all_rows(self, scene: Scene) -> list[Rows]:
        """Rows of its whole period."""
        return list(self.rows(scene, self.frames(scene).tolist()))

    def scale(self, scene: Scene) -> float:
        """What rows are multiplied by for `unit`."""
        return 1.0

    def about(self) -> str:
        """The constraint in a few words."""
        raise NotImplementedError


class Violation(NamedTuple):
    """By how much a constraint is missed.

    Attributes:
        about: the constraint in a few words.
        largest: over its period, in `unit`.
        time: when [s of the clip].
        unit: m, m/s or °.
        holds: whether it is missed by no more than what counts.
    """

    about: str
    largest: float
    time: float
    unit: str
    holds: bool


def violation(constraint: Constraint, scene: Scene) -> Violation:
    """The largest excess of a constraint over its period."""
    rows = constraint.all_rows(scene)
    excesses = np.array([row.excess.max() for row in rows])
    worst = int(np.argmax(excesses))
    largest = float(excesses[worst]) * constraint.scale(scene)
    time = float(scene.times[max(rows[worst].parts)])
    return Violation(constraint.about(), largest, time, constraint.unit,
                     largest <= constraint.tolerance)  # fmt: skip
