"""Constraints in a YAML file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from poise.configs.errors import ConfigError
from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml

from .constraint import Constraint
from .scene import Scene

MOST = 100


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
