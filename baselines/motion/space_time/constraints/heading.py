"""Where the body faces."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.baselines.motion.retargeting.limbs import LimbVector
from poise.configs.errors import ConfigError

from .constraint import Constraint
from .scene import ConstraintRows, Scene

LINES = {"hips": "hip", "shoulders": "shoulder"}


@dataclass(frozen=True, kw_only=True)
class Heading(Constraint):
    """|ψ − angle| ≤ within; ψ is the heading of what is square to a line from right to left.

    Attributes:
        angle: to the left of where the robot stands [degrees].
        of: the line of the hips or of the shoulders.
        within: [degrees].
    """

    unit: ClassVar[str] = "°"
    tolerance: ClassVar[float] = 0.1

    angle: float
    kind: Literal["heading"] = "heading"
    of: Literal["hips", "shoulders"] = "hips"
    within: float = field(default=0.0, metadata={"min": 0.0})

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """ψ − angle [rad], one row a frame: with the line (x, y), ψ = atan2(−x, y)."""
        if f"{LINES[self.of]}_left" not in scene.limbs.points:
            raise ConfigError(f"the robot {scene.robot.name!r} has no {self.of}", field="of",
                              choices=("hips",))  # fmt: skip
        left, right = (scene.limbs.points[f"{LINES[self.of]}_{s}"] for s in ("left", "right"))
        line, bound = LimbVector(left, right), np.array([np.radians(self.within)])
        for frame in frames:
            data = scene.at(frame)
            (x, y, _), moved = line.place(data), line.jacobian(scene.model, data)
            off = np.arctan2(-x, y) - np.radians(self.angle)
            off = (off + np.pi) % (2.0 * np.pi) - np.pi
            derivative = (x * moved[1:2] - y * moved[0:1]) / (x * x + y * y)
            yield ConstraintRows({frame: derivative}, np.array([off]), -bound, bound)

    def scale(self, scene: Scene) -> float:
        """From radians to degrees."""
        return float(np.degrees(1.0))

    def about(self) -> str:
        return f"heading of the {self.of} {self.angle:g}°"
