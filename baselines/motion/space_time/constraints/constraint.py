"""What a constraint is: rows of the whole clip, begun where the motion is now; when it holds; and
constraints in a YAML file."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.files import resolve
from poise.configs.kinds import OfKind
from poise.configs.schema import build, read_yaml

from .scene import ConstraintRows, Scene

PERIOD = "period"
MOST = 100  # constraints of a file


@dataclass(frozen=True)
class When:
    """One of: a time [s], planted feet, a part of the clip.

    Attributes:
        at: the frame nearest to a time of the clip [s].
        contact: while this foot is planted, or both are.
        phase: from and to, as fractions of the clip.
    """

    at: float | None = None
    contact: Literal["left", "right", "both"] | None = None
    phase: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if sum(value is not None for value in (self.at, self.contact, self.phase)) != 1:
            raise ValueError("must have one of at, contact, phase")


Period = Literal["always"] | tuple[float, float] | When


def period_frames(period: Period, scene: Scene) -> np.ndarray:
    """The frames (k,) of a period; ``always`` is the clip without what leads from and to standing.

    Raises ConfigError for a period without frames: it names the clip's times.
    """
    inside = (scene.times > -0.5 * scene.dt) & (scene.times < scene.duration + 0.5 * scene.dt)
    if isinstance(period, When) and period.contact is not None:
        sides = scene.sides.values() if period.contact == "both" else [scene.sides[period.contact]]
        found = np.flatnonzero(inside & scene.planted[:, list(sides)].all(axis=1))
        if not found.size:
            raise ConfigError(f"the feet {period.contact!r} are never planted",
                              field=f"{PERIOD}.contact")  # fmt: skip
        return found
    begin, end = _times(period, scene)
    text = f"[{begin:g}, {end:g}] s of a clip from 0 to {scene.duration:.2f} s"
    if begin > end:
        raise ConfigError(f"ends before it begins: {text}", field=PERIOD)
    if isinstance(period, When) and period.at is not None:
        nearest = int(np.argmin(np.abs(scene.times - begin)))
        found = np.flatnonzero(inside & (np.arange(len(scene)) == nearest))
    else:
        half = 0.5 * scene.dt
        found = np.flatnonzero(inside & (scene.times >= begin - half) & (scene.times <= end + half))
    if not found.size:
        raise ConfigError(f"has no frames: {text}", field=PERIOD)
    return found


def _times(period: Period, scene: Scene) -> tuple[float, float]:
    """Begin and end [s] of a period that is no contact."""
    if period == "always":
        return 0.0, scene.duration
    if not isinstance(period, When):
        begin, end = period
        return float(begin), float(end)
    if period.phase is not None:
        return period.phase[0] * scene.duration, period.phase[1] * scene.duration
    assert period.at is not None
    return period.at, period.at


@dataclass(frozen=True, kw_only=True)
class Constraint(OfKind):
    """Base of constraints: a subclass is a frozen dataclass with a `kind` to be named by.

    Attributes:
        period: when it holds, see `period_frames`.
        weight: of its violation, beside the others'.
    """

    room: ClassVar[str] = str(__package__)
    unit: ClassVar[str] = "m"  #: of what `violation` says
    tolerance: ClassVar[float] = 1e-3  #: a violation beyond it counts, in that unit

    period: Period = "always"
    weight: float = field(default=1.0, metadata={"above": 0.0})

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """Rows at some frames, in metres or radians; of several frames at the last of them.

        Raises ConfigError for a point that the robot does not have.
        """
        raise NotImplementedError

    def frames(self, scene: Scene) -> np.ndarray:
        """The frames (k,) at which it holds."""
        return period_frames(self.period, scene)

    def all_rows(self, scene: Scene) -> list[ConstraintRows]:
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


@dataclass(frozen=True)
class _File:
    constraints: tuple[Constraint, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.constraints) <= MOST:
            raise ValueError(f"must be 1 to {MOST} constraints, not {len(self.constraints)}")


def read_constraints(file: str | Path) -> tuple[Constraint, ...]:
    """The constraints of a packaged name or a path to a ``.yaml`` file.

    Raises:
        ConfigError: no such file; an unknown kind or field, a value out of range. The text names
            the file, the field and the valid choices.
    """
    path = resolve("constraints", file)
    return build(_File, read_yaml(path), path).constraints


def check_constraints(
    constraints: Sequence[Constraint], scene: Scene, source: str | Path | None
) -> None:
    """Raise ConfigError for a point that the robot lacks, or a period that the clip lacks."""
    for i, constraint in enumerate(constraints):
        try:
            constraint.all_rows(scene)
        except ConfigError as error:
            raise ConfigError(error.message, source=source, field=f"constraints[{i}].{error.field}",
                              choices=error.choices) from None  # fmt: skip
