"""Tasks of the momentum QP: rows of ½ Σ weights (A v̇ − b)² from gains without units."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from poise.configs.errors import below
from poise.configs.kinds import OfKind
from poise.envs.compiled.block import Block
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

B = TypeVar("B", bound=Block)


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
class Task(OfKind, Generic[B]):
    """Base of tasks. A subclass is a frozen dataclass of gains, with a `kind` to be named by.

    Gains have no units (see `gains.py`). `bind` makes the block that the task works on: gains in
    SI units, and a reference that may be written to at any time. `rows` is the specification.
    `kernel`, a compiled function of a `TaskTick`, fills the same rows; without one the controller
    calls `rows`, and runs from Python.
    """

    room: ClassVar[str] = str(__package__)
    size: ClassVar[int]  #: rows
    kernel: ClassVar[Callable[..., None] | None] = None  #: as `staticmethod(compiled function)`

    def bind(self, robot: Robot) -> B:
        """The block of this task for a robot."""
        raise NotImplementedError

    def rows(self, state: RobotState, block: B) -> Rows:
        """`size` rows in v̇, in NumPy."""
        raise NotImplementedError


class BoundTask(NamedTuple, Generic[B]):
    """A task, and the block that it works on for one robot."""

    task: Task[B]
    block: B

    def rows(self, state: RobotState) -> Rows:
        """The rows of a state."""
        return self.task.rows(state, self.block)


def bind_tasks(tasks: Mapping[str, Task], robot: Robot) -> dict[str, BoundTask]:
    """The tasks of a configuration for one robot.

    Raises ConfigError naming the task for a body or a point that the robot does not have.
    """
    bound = {}
    for name, task in tasks.items():
        with below("tasks", name):
            bound[name] = BoundTask(task, task.bind(robot))
    return bound


def spring(units: Units, stiffness: float, damping_ratio: float) -> tuple[float, float]:
    """k [1/s²] and d = 2 ζ √k [1/s], from a stiffness in ω² and a damping ratio ζ."""
    k = stiffness * units.omega**2
    return float(k), float(2.0 * damping_ratio * np.sqrt(k))
