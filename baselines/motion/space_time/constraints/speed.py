"""How fast a point moves."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from .constraint import Constraint
from .height import between, check_bounds
from .scene import Rows, Scene

STILL = 1e-6  # [m] of a step without a direction


@dataclass(frozen=True, kw_only=True)
class Speed(Constraint):
    """least ≤ ‖p(t) − p(t − dt)‖/dt ≤ most.

    Attributes:
        point: a limb's role such as hand_right, com, or a body.
        least, most: [m/s].
    """

    unit: ClassVar[str] = "m/s"
    tolerance: ClassVar[float] = 1e-2

    point: str
    kind: Literal["speed"] = "speed"
    least: float | None = field(default=None, metadata={"min": 0.0})
    most: float | None = field(default=None, metadata={"min": 0.0})

    def __post_init__(self) -> None:
        check_bounds(self.least, self.most)

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[Rows]:
        """The length of the step from the frame before [m], one row a frame."""
        point = scene.point(self.point, "point")
        low = np.array([-np.inf if self.least is None else self.least * scene.dt])
        high = np.array([np.inf if self.most is None else self.most * scene.dt])
        for frame in frames:
            if frame == 0:
                continue
            before, after = point.place(scene.at(frame - 1)), point.place(scene.at(frame))
            step = after - before
            length = float(np.linalg.norm(step))
            if length > STILL:
                way = step / length
            else:  # any direction: a step that is to grow needs one
                way = np.array([1.0, 0.0, 0.0])
            parts = {f: sign * way[None] @ point.jacobian(scene.model, scene.at(f))
                     for f, sign in ((frame - 1, -1.0), (frame, 1.0))}  # fmt: skip
            yield Rows(parts, np.array([length]), low, high)

    def scale(self, scene: Scene) -> float:
        """From metres a frame to metres a second."""
        return 1.0 / scene.dt

    def about(self) -> str:
        return f"speed of {self.point} {between(self.least, self.most, 'm/s')}"
