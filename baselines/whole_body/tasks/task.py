"""Tasks of the momentum QP: rows of ½ Σ weights (A v̇ − b)² from gains without units."""

from dataclasses import dataclass
from typing import ClassVar, Generic, NamedTuple

import numpy as np

from poise.baselines.whole_body.parts.part import B, Part
from poise.envs.compiled.block import Block
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState


class Rows(NamedTuple):
    """A task: ½ Σ weights (A x − b)². A may stop short: the columns left out are zero."""

    A: np.ndarray  # (k, ≤ n)
    b: np.ndarray  # (k,)
    weights: np.ndarray  # (k,)


@dataclass(frozen=True, eq=False)
class RowArrays(Block):
    """The part of the stack that a task writes its k rows to."""

    A: np.ndarray  # (k, nv); zero before the first tick
    b: np.ndarray  # (k,)
    weights: np.ndarray  # (k,)


@dataclass(frozen=True, eq=False)
class TaskTick(Block, Generic[B]):
    """All that a task's kernel works on."""

    state: StateArrays
    task: B  # the task's own block, made by `bind`
    rows: RowArrays


@dataclass(frozen=True)
class Task(Part[B]):
    """Base of tasks, see `Part`. Their blocks have gains and a reference.

    `rows` is the specification. `kernel`, of a `TaskTick`, fills the same rows; without one the
    controller calls `rows`, and runs from Python.
    """

    room: ClassVar[str] = str(__package__)
    size: ClassVar[int]  #: rows

    def rows(self, state: RobotState, block: B) -> Rows:
        """`size` rows in v̇, in NumPy."""
        raise NotImplementedError


def spring(units: Units, stiffness: float, damping_ratio: float) -> tuple[float, float]:
    """k [1/s²] and d = 2 ζ √k [1/s], from a stiffness in ω² and a damping ratio ζ."""
    k = stiffness * units.omega**2
    return float(k), float(2.0 * damping_ratio * np.sqrt(k))
