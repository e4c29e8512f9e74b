"""A point at a place."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from .constraint import Constraint
from .scene import Rows, Scene


@dataclass(frozen=True, kw_only=True)
class Reach(Constraint):
    """p = place, by coordinates.

    Attributes:
        point: a limb's role such as hand_left, com, or a body.
        place: x ahead, y to the left, z up, from the middle between the soles as the robot stands;
            null leaves a coordinate free [m].
        to: a point that p is relative to, in the world's axes.
        within: by what each coordinate may be off [m].
    """

    point: str
    place: tuple[float | None, float | None, float | None]
    kind: Literal["reach"] = "reach"
    to: str | None = None
    within: float = field(default=0.0, metadata={"min": 0.0})

    def __post_init__(self) -> None:
        if all(value is None for value in self.place):
            raise ValueError("place must have a number")

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """p − place, a row for each given coordinate."""
        point = scene.between(self.point, self.to)
        given = [i for i, value in enumerate(self.place) if value is not None]
        goal = np.array([self.place[i] for i in given])
        bound = np.full(len(given), self.within)
        for frame in frames:
            data = scene.at(frame)
            derivative = point.jacobian(scene.model, data)[given]
            yield Rows({frame: derivative}, point.place(data)[given] - goal, -bound, bound)

    def about(self) -> str:
        place = ", ".join("free" if value is None else f"{value:g}" for value in self.place)
        return f"reach ({place}) by {self.point}" + (f" from {self.to}" if self.to else "")
