"""A point that stays where it is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .constraint import Constraint
from .scene import Rows, Scene


@dataclass(frozen=True, kw_only=True)
class Keep(Constraint):
    """p(t) = y for all t of the period; the place y is whatever suits the motion best.

    Attributes:
        point: a limb's role such as hand_left, com, or a body.
        to: a point that p is relative to, in the world's axes; without one p is in the world.
        within: by what each coordinate may leave y [m].
    """

    point: str
    kind: Literal["keep"] = "keep"
    to: str | None = None
    within: float = field(default=0.0, metadata={"min": 0.0})

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """p − y, three rows a frame; y is the middle of its places in the whole period."""
        point, bound = scene.between(self.point, self.to), np.full(3, self.within)
        places = {f: point.place(scene.at(f)) for f in self.frames(scene).tolist()}
        among = np.array(list(places.values()))
        middle = 0.5 * (among.min(axis=0) + among.max(axis=0))
        for frame in frames:
            derivative = point.jacobian(scene.model, scene.at(frame))
            yield Rows({frame: derivative}, places[frame] - middle, -bound, bound, shared=True)

    def about(self) -> str:
        return f"keep {self.point}" + (f" to {self.to}" if self.to else "")
