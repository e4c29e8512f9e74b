"""When a constraint holds."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from poise.configs.errors import ConfigError

from .scene import Scene

FIELD = "period"


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


def frames_of(period: Period, scene: Scene) -> np.ndarray:
    """The frames (k,) of a period; ``always`` is the clip without what leads from and to standing.

    Raises ConfigError for a period without frames: it names the clip's times.
    """
    inside = (scene.times > -0.5 * scene.dt) & (scene.times < scene.duration + 0.5 * scene.dt)
    if isinstance(period, When) and period.contact is not None:
        sides = scene.sides.values() if period.contact == "both" else [scene.sides[period.contact]]
        found = np.flatnonzero(inside & scene.planted[:, list(sides)].all(axis=1))
        if not found.size:
            raise ConfigError(f"the feet {period.contact!r} are never planted",
                              field=f"{FIELD}.contact")  # fmt: skip
        return found
    begin, end = _times(period, scene)
    text = f"[{begin:g}, {end:g}] s of a clip from 0 to {scene.duration:.2f} s"
    if begin > end:
        raise ConfigError(f"ends before it begins: {text}", field=FIELD)
    if isinstance(period, When) and period.at is not None:
        nearest = int(np.argmin(np.abs(scene.times - begin)))
        found = np.flatnonzero(inside & (np.arange(len(scene)) == nearest))
    else:
        half = 0.5 * scene.dt
        found = np.flatnonzero(inside & (scene.times >= begin - half) & (scene.times <= end + half))
    if not found.size:
        raise ConfigError(f"has no frames: {text}", field=FIELD)
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
