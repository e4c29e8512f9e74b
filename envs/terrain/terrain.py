"""Terrain: surfaces above a floor, as a planner assumes them, and as they are."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.kinds import OfKind
from poise.configs.schema import build, to_dict

SIDE = 1.5  # [m] half width of what is built across the way
BEHIND = 2.0  # [m] by which it reaches behind the start
BEYOND = 4.0  # [m] by which it goes on behind the last step


class Surface(NamedTuple):
    """A rectangle of the ground, level across the way [m]."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float
    height: float  # in its middle
    gradient: float  # dz/dx

    @property
    def middle(self) -> np.ndarray:
        """(3,) its centre [m]."""
        x, y = 0.5 * (self.x_min + self.x_max), 0.5 * (self.y_min + self.y_max)
        return np.array([x, y, self.height])


@dataclass(frozen=True)
class Terrain(OfKind):
    """Base of the kinds of terrain, which go along x from where the robot starts, facing x.

    The start is at z = 0.

    Attributes:
        error: Largest difference of a surface's height from the assumed one, uniform in ± [m]; the
            start's has none.
        unseen: Whether planners assume level ground, without any surface to step on.
        seed: Seed of the heights' errors, and of what else a kind draws.
    """

    room: ClassVar[str] = str(__package__)

    error: float = field(default=0.0, kw_only=True, metadata={"min": 0.0, "max": 0.2})
    unseen: bool = field(default=False, kw_only=True)
    seed: int = field(default=0, kw_only=True, metadata={"min": 0})

    @property
    def flat(self) -> bool:
        """Whether this is level ground, of which nothing is built."""
        return not self.surfaces()

    def nominal(self) -> list[Surface]:
        """The surfaces without errors, in the order of the way; the first is that of the start."""
        raise NotImplementedError

    def surfaces(self) -> list[Surface]:
        """The surfaces that there are."""
        nominal = self.nominal()
        rng = np.random.default_rng([self.seed, 1])
        errors = rng.uniform(-self.error, self.error, len(nominal))
        errors[:1] = 0.0
        moved = zip(nominal, errors.tolist(), strict=True)
        return [surface._replace(height=surface.height + error) for surface, error in moved]

    def assumed(self) -> list[Surface]:
        """Return the surfaces that a planner assumes; empty for level ground."""
        return [] if self.unseen else self.nominal()

    def floor(self) -> float:
        """The height of the plane below all surfaces [m]."""
        lowest = [each.height - 0.5 * abs(each.gradient) * (each.x_max - each.x_min)
                  for each in self.surfaces()]  # fmt: skip
        return min([0.0, *lowest])

    def height(self, x: float, y: float) -> float:
        """The height of the ground at (x, y) [m]."""
        return height_at(self.surfaces(), self.floor(), x, y)


def height_at(surfaces: Sequence[Surface], floor: float, x: float, y: float) -> float:
    """The height of the highest of `surfaces` at (x, y), the `floor` where there is none [m]."""
    found = [
        s.height + s.gradient * (x - 0.5 * (s.x_min + s.x_max))
        for s in surfaces
        if s.x_min <= x <= s.x_max and s.y_min <= y <= s.y_max
    ]
    return max(found, default=floor)


def make_terrain(value: object, source: str = "environment") -> Terrain:
    """A terrain from itself, from the name of a kind, or from a mapping with its `kind`.

    Raises ConfigError naming `source`, the field and the choices for what is not valid.
    """
    if isinstance(value, Terrain):
        return value
    if isinstance(value, str):
        value = {"kind": value}
    if not isinstance(value, Mapping):
        raise ConfigError(f"must be a kind or a mapping, not {shown(value)}", source=source,
                          field="terrain", choices=Terrain.kinds())  # fmt: skip
    mapping = {str(key): to_dict(entry) for key, entry in value.items()}
    return build(_Given, {"terrain": mapping}, source).terrain


@dataclass(frozen=True)
class _Given:
    """What is built of a mapping, so that errors name the field."""

    terrain: Terrain


def seeded(terrain: Terrain, seed: int) -> Terrain:
    """The same terrain with other errors."""
    return replace(terrain, seed=seed)
