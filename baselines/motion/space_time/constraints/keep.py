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
        points = [scene.point(self.point, "point")]
        points += [scene.point(self.to, "to")] if self.to is not None else []
        places = {f: _difference([p.place(scene.at(f)) for p in points])
                  for f in self.frames(scene).tolist()}  # fmt: skip
        among = np.array(list(places.values()))
        middle = 0.5 * (among.min(axis=0) + among.max(axis=0))
        for frame in frames:
            data = scene.at(frame)
            derivative = _difference([p.jacobian(scene.model, data) for p in points])
            bound = np.full(3, self.within)
            yield Rows({frame: derivative}, places[frame] - middle, -bound, bound, shared=True)

    def about(self) -> str:
        return f"keep {self.point}" + (f" to {self.to}" if self.to else "")


def _difference(values: list[np.ndarray]) -> np.ndarray:
    return values[0] - values[1] if len(values) == 2 else values[0]
