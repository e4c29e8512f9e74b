"""Limits of the momentum QP: rows l ≤ C x ≤ u from gains without units."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from poise.configs.errors import below
from poise.configs.kinds import OfKind
from poise.envs.compiled.block import Block
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.description import match_names
from poise.envs.robots.robot import Robot

B = TypeVar("B", bound=Block)


class Bounds(NamedTuple):
    """A constraint: l ≤ C x ≤ u. C may stop short: the columns left out are zero."""

    C: np.ndarray  # (k, ≤ n)
    l: np.ndarray  # (k,)  # noqa: E741
    u: np.ndarray  # (k,)


@dataclass(frozen=True, eq=False)
class BoundArrays(Block):
    """The part of the constraints that a limit writes its k rows to, in the n reduced unknowns."""

    C: np.ndarray  # (k, n)
    l: np.ndarray  # noqa: E741  (k,)
    u: np.ndarray  # (k,)


@dataclass(frozen=True, eq=False)
class ReducedMotion(Block):
    """Accelerations v̇ = V x + v̇₀ and joint torques τ = T x + τ₀ in the reduced unknowns x."""

    V: np.ndarray  # (nv, n)
    vdot0: np.ndarray  # (nv,)
    T: np.ndarray  # (nv−6, n)
    tau0: np.ndarray  # (nv−6,)


@dataclass(frozen=True, eq=False)
class LimitTick(Block, Generic[B]):
    """All that a limit's kernel works on."""

    state: StateArrays
    motion: ReducedMotion
    limit: B  # the limit's own block, made by `bind`
    rows: BoundArrays


@dataclass(frozen=True)
class Limit(OfKind, Generic[B]):
    """Base of limits. A subclass is a frozen dataclass of gains, with a `kind` to be named by.

    Gains have no units (see `gains.py`). `bind` makes the block that the limit works on, in SI
    units; its arrays may be written to at any time. `rows` is the specification, in the unknowns
    (v̇, w) of `formulation.py`. `kernel`, a compiled function of a `LimitTick`, fills the same
    rows in the reduced unknowns.
    """

    room: ClassVar[str] = str(__package__)
    kernel: ClassVar[Callable[..., None]]  #: as `staticmethod(compiled function)`

    def bind(self, robot: Robot) -> B:
        """Return the block of this limit for a robot."""
        raise NotImplementedError

    def size(self, block: B) -> int:
        """Return the number of rows."""
        raise NotImplementedError

    def rows(self, state: RobotState, block: B, torques: np.ndarray) -> Bounds:
        """Return the rows in (v̇, w), in NumPy.

        Args:
            torques: (nv−6, nv+k) T of the joint torques τ = T (v̇, w) + h.
        """
        raise NotImplementedError


class BoundLimit(NamedTuple, Generic[B]):
    """A limit, and the block that it works on for one robot."""

    limit: Limit[B]
    block: B

    @property
    def size(self) -> int:
        """The number of rows."""
        return self.limit.size(self.block)

    def rows(self, state: RobotState, torques: np.ndarray) -> Bounds:
        """Return the rows of a state, see `Limit.rows`."""
        return self.limit.rows(state, self.block, torques)


def bind_limits(limits: Mapping[str, Limit], robot: Robot) -> dict[str, BoundLimit]:
    """Return the limits of a configuration for one robot.

    Raises ConfigError naming the limit for a joint that the robot does not have.
    """
    bound = {}
    for name, limit in limits.items():
        with below("limits", name):
            bound[name] = BoundLimit(limit, limit.bind(robot))
    return bound


def joint_indices(robot: Robot, patterns: Sequence[str]) -> np.ndarray:
    """Return the indices (k,) of the joints with these names, or that match these patterns.

    Raises ConfigError for a name or pattern that no joint has.
    """
    names = list(robot.joint_names)
    chosen = match_names(dict.fromkeys(patterns, True), names, "", "joints")
    return np.array([i for i, name in enumerate(names) if name in chosen], dtype=np.int64)
