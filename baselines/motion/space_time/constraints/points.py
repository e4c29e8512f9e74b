"""Where points are: kept, reached, high, fast, apart, over the support."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from scipy.spatial import ConvexHull

from .constraint import Constraint
from .scene import ConstraintRows, Scene

STILL = 1e-6  # [m] of a step without a direction


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

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """p − y, three rows a frame; y is the middle of its places in the whole period."""
        point, bound = scene.between(self.point, self.to), np.full(3, self.within)
        places = {f: point.place(scene.at(f)) for f in self.frames(scene).tolist()}
        among = np.array(list(places.values()))
        middle = 0.5 * (among.min(axis=0) + among.max(axis=0))
        for frame in frames:
            derivative = point.jacobian(scene.model, scene.at(frame))
            yield ConstraintRows(
                {frame: derivative}, places[frame] - middle, -bound, bound, shared=True
            )

    def about(self) -> str:
        return f"keep {self.point}" + (f" to {self.to}" if self.to else "")


@dataclass(frozen=True, kw_only=True)
class PointReach(Constraint):
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

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """p − place, a row for each given coordinate."""
        point = scene.between(self.point, self.to)
        given = [i for i, value in enumerate(self.place) if value is not None]
        goal = np.array([self.place[i] for i in given])
        bound = np.full(len(given), self.within)
        for frame in frames:
            data = scene.at(frame)
            derivative = point.jacobian(scene.model, data)[given]
            yield ConstraintRows(
                {frame: derivative}, point.place(data)[given] - goal, -bound, bound
            )

    def about(self) -> str:
        place = ", ".join("free" if value is None else f"{value:g}" for value in self.place)
        return f"reach ({place}) by {self.point}" + (f" from {self.to}" if self.to else "")


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

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """One row a frame."""
        points = scene.between(self.point, self.to)
        low, high = np.array([self.distance]), np.array([np.inf])
        for frame in frames:
            data = scene.at(frame)
            between = points.place(data)
            length = float(np.linalg.norm(between))
            way = between / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
            derivative = way[None] @ points.jacobian(scene.model, data)
            yield ConstraintRows({frame: derivative}, np.array([length]), low, high)

    def about(self) -> str:
        return f"{self.point} and {self.to} apart by {self.distance:g} m"


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

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
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
            yield ConstraintRows({frame: derivative}, value, np.full(len(sides), -np.inf), bound)

    def about(self) -> str:
        return f"{self.point} over the support by {self.margin:g} m"


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
        _check_bounds(self.least, self.most)

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """One row a frame."""
        point = scene.point(self.point, "point")
        low = np.array([-np.inf if self.least is None else self.least])
        high = np.array([np.inf if self.most is None else self.most])
        for frame in frames:
            data = scene.at(frame)
            derivative = point.jacobian(scene.model, data)[2:]
            yield ConstraintRows({frame: derivative}, point.place(data)[2:], low, high)

    def about(self) -> str:
        return f"height of {self.point} {_in_words(self.least, self.most, 'm')}"


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
        _check_bounds(self.least, self.most)

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
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
            yield ConstraintRows(parts, np.array([length]), low, high)

    def scale(self, scene: Scene) -> float:
        """From metres a frame to metres a second."""
        return 1.0 / scene.dt

    def about(self) -> str:
        return f"speed of {self.point} {_in_words(self.least, self.most, 'm/s')}"


def _check_bounds(least: float | None, most: float | None) -> None:
    """Raise ValueError unless there is a bound, and room between two."""
    if least is None and most is None:
        raise ValueError("needs least or most")
    if least is not None and most is not None and least > most:
        raise ValueError(f"least {least:g} is above most {most:g}")


def _in_words(least: float | None, most: float | None, unit: str) -> str:
    """Bounds in words."""
    parts = (f"≥ {least:g}" if least is not None else "", f"≤ {most:g}" if most is not None else "")
    return " and ".join(part for part in parts if part) + f" {unit}"
