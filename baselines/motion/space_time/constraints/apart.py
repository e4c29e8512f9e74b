"""Two points that keep a distance."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .constraint import Constraint
from .scene import Rows, Scene


@dataclass(frozen=True, kw_only=True)
class Apart(Constraint):
    """‖p − p'‖ ≥ distance.

    Attributes:
        point, to: limbs' roles such as hand_left, com, or bodies.
        distance: [m].
    """

    point: str
    to: str
    distance: float = field(metadata={"above": 0.0})
    kind: Literal["apart"] = "apart"

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """One row a frame."""
        points = scene.between(self.point, self.to)
        low, high = np.array([self.distance]), np.array([np.inf])
        for frame in frames:
            data = scene.at(frame)
            between = points.place(data)
            length = float(np.linalg.norm(between))
            way = between / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
            derivative = way[None] @ points.jacobian(scene.model, data)
            yield Rows({frame: derivative}, np.array([length]), low, high)

    def about(self) -> str:
        return f"{self.point} and {self.to} apart by {self.distance:g} m"
