"""The CoM, or another point, over the planted soles."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.spatial import ConvexHull

from .constraint import Constraint
from .scene import Rows, Scene


@dataclass(frozen=True, kw_only=True)
class OverSupport(Constraint):
    """nᵢ · p ≤ dᵢ − margin for all sides i of the hull of the planted soles, from above.

    Attributes:
        point: com, a limb's role or a body.
        margin: how far inside [m].
    """

    kind: Literal["over_support"] = "over_support"
    point: str = "com"
    margin: float = field(default=0.02, metadata={"min": 0.0})

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """A row for each side of the hull; none where no sole is planted."""
        point = scene.point(self.point, "point")
        for frame in frames:
            data = scene.at(frame)
            soles = scene.planted_corners[frame, scene.planted[frame], :, :2].reshape(-1, 2)
            if not len(soles):
                continue
            sides = ConvexHull(soles).equations  # n · x + b ≤ 0 inside
            value = sides[:, :2] @ point.place(data)[:2] + sides[:, 2]
            derivative = sides[:, :2] @ point.jacobian(scene.model, data)[:2]
            bound = np.full(len(sides), -self.margin)
            yield Rows({frame: derivative}, value, np.full(len(sides), -np.inf), bound)

    def about(self) -> str:
        return f"{self.point} over the support by {self.margin:g} m"
