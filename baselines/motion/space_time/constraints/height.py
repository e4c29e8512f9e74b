"""How high a point is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .constraint import Constraint
from .scene import Rows, Scene


@dataclass(frozen=True, kw_only=True)
class Height(Constraint):
    """least ≤ p_z ≤ most.

    Attributes:
        point: a limb's role such as pelvis, com, or a body.
        least, most: above the ground [m].
    """

    point: str
    kind: Literal["height"] = "height"
    least: float | None = None
    most: float | None = None

    def __post_init__(self) -> None:
        check_bounds(self.least, self.most)

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """One row a frame."""
        point = scene.point(self.point, "point")
        low = np.array([-np.inf if self.least is None else self.least])
        high = np.array([np.inf if self.most is None else self.most])
        for frame in frames:
            data = scene.at(frame)
            derivative = point.jacobian(scene.model, data)[2:]
            yield Rows({frame: derivative}, point.place(data)[2:], low, high)

    def about(self) -> str:
        return f"height of {self.point} {between(self.least, self.most, 'm')}"


def check_bounds(least: float | None, most: float | None) -> None:
    """Raise ValueError unless there is a bound, and room between two."""
    if least is None and most is None:
        raise ValueError("needs least or most")
    if least is not None and most is not None and least > most:
        raise ValueError(f"least {least:g} is above most {most:g}")


def between(least: float | None, most: float | None, unit: str) -> str:
    """Bounds in words."""
    parts = (f"≥ {least:g}" if least is not None else "", f"≤ {most:g}" if most is not None else "")
    return " and ".join(part for part in parts if part) + f" {unit}"
