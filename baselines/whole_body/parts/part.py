"""A part of the momentum QP: gains without units, and the block that works for one robot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from poise.configs.errors import below
from poise.configs.kinds import OfKind
from poise.envs.compiled.block import Block
from poise.envs.robots.robot import Robot

B = TypeVar("B", bound=Block)


@dataclass(frozen=True)
class Part(OfKind, Generic[B]):
    """Base of tasks, contacts and limits: frozen dataclasses of gains, named by their `kind`.

    Gains have no units (see `gains.py`). `bind` makes the block that the part works on, in SI
    units; its arrays may be written to at any time. A part also has `rows`, its specification, and
    `kernel`, a compiled function that fills the same.
    """

    kernel: ClassVar[Callable[..., None] | None] = None  #: as `staticmethod(compiled function)`

    def bind(self, robot: Robot) -> B:
        """The block of this part for a robot."""
        raise NotImplementedError


P = TypeVar("P", bound=Part)


class Bound(NamedTuple, Generic[P]):
    """A part, and the block that it works on for one robot."""

    part: P
    block: Any

    def rows(self, state: Any, *further: np.ndarray) -> Any:
        """The rows of a state, or of what else the part takes, see its `rows`."""
        part: Any = self.part
        return part.rows(state, self.block, *further)


def bind_parts(parts: Mapping[str, P], robot: Robot, field: str) -> dict[str, Bound[P]]:
    """The parts in a `field` of a configuration for one robot.

    Raises ConfigError naming the part for a body, a point or a joint that the robot does not have.
    """
    bound = {}
    for name, part in parts.items():
        with below(field, name):
            bound[name] = Bound(part, part.bind(robot))
    return bound
