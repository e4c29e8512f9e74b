"""Limits of the momentum QP: rows l ≤ C x ≤ u from gains without units."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, NamedTuple

import numpy as np

from poise.baselines.whole_body.parts.part import B, Part
from poise.baselines.whole_body.parts.reduced_motion import ReducedMotion
from poise.envs.compiled.block import Block
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.description import match_names
from poise.envs.robots.robot import Robot


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
class LimitTick(Block, Generic[B]):
    """All that a limit's kernel works on."""

    state: StateArrays
    motion: ReducedMotion
    limit: B  # the limit's own block, made by `bind`
    rows: BoundArrays


@dataclass(frozen=True)
class Limit(Part[B]):
    """Base of limits, see `Part`.

    `rows` is the specification, in the unknowns (v̇, w) of `formulation.py`. `kernel`, of a
    `LimitTick`, fills the same rows in the reduced unknowns.
    """

    room: ClassVar[str] = str(__package__)

    def size(self, block: B) -> int:
        """Return the number of rows."""
        raise NotImplementedError

    def rows(self, state: RobotState, block: B, torques: np.ndarray) -> Bounds:
        """Return the rows in (v̇, w), in NumPy.

        Args:
            torques: (nv−6, nv+k) T of the joint torques τ = T (v̇, w) + h.
        """
        raise NotImplementedError


def joint_indices(robot: Robot, patterns: Sequence[str]) -> np.ndarray:
    """Return the indices (k,) of the joints with these names, or that match these patterns.

    Raises ConfigError for a name or pattern that no joint has.
    """
    names = list(robot.joint_names)
    chosen = match_names(dict.fromkeys(patterns, True), names, "", "joints")
    return np.array([i for i, name in enumerate(names) if name in chosen], dtype=np.int64)
