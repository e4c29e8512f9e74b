"""Tasks of the momentum QP: terms ½ Σ weights (A x − b)² of its objective."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, Generic, NamedTuple

import numpy as np

from poise.baselines.controller import TargetArrays, Targets
from poise.baselines.whole_body.parts.part import B, Bound, Part
from poise.baselines.whole_body.parts.reduced_motion import ReducedMotion
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState


class Rows(NamedTuple):
    """A term ½ Σ weights (A x − b)². A may stop short: the columns left out are zero."""

    A: np.ndarray  # (k, ≤ n)
    b: np.ndarray  # (k,)
    weights: np.ndarray  # (k,)


class TaskSpace(Enum):
    """What a task weighs, and so in which space its error is.

    `MOTION` is A v̇ with an A of the task's own. The others are quantities y that the problem has
    anyway: the task is ½ Σ weights (y − y_des)², and its kernel fills y_des and the weights only.
    """

    MOTION = "A v̇"
    ACCELERATION = "v̇"  # (nv,)
    FORCE = "total contact force"  # (3,) Ṗ − m g [N]
    MOMENT = "total contact moment"  # (3,) about the CoM: L̇ [N·m]
    WRENCHES = "wrenches of the soles"  # (6 nc,) world axes, at the sole points
    TORQUES = "joint torques"  # (nv−6,)
    ROOT = "wrench on a soft root"  # (6,) about the CoM; (0,) with a hard root


class TaskInput(NamedTuple):
    """What a task may read in a tick, in NumPy."""

    state: RobotState
    targets: Targets | TargetArrays
    support: RobotState  # the same with the soles in contact alone
    cop_vel: np.ndarray  # (2,) ṗ [m/s], measured between ticks
    force: np.ndarray  # (3,) Ṗ_des − m g [N] of the task before that weighs FORCE; else −m g
    torques: np.ndarray  # (nv−6, nv+k) T of the joint torques τ = T (v̇, w) + h


@dataclass(frozen=True, eq=False)
class RowArrays(Block):
    """The arrays that a task's kernel fills."""

    A: np.ndarray  # (k, nv) of MOTION, zero before the first tick; else (0, nv)
    b: np.ndarray  # (k,) b of MOTION; else y_des
    weights: np.ndarray  # (k,)


@dataclass(frozen=True, eq=False)
class TaskTick(Block, Generic[B]):
    """All that a task's kernel works on: what `TaskInput` has, its block and its rows."""

    state: StateArrays
    targets: TargetArrays
    support: StateArrays
    cop_vel: np.ndarray
    force: np.ndarray
    motion: ReducedMotion
    task: B  # the task's own block, made by `bind`
    rows: RowArrays


@compiled
def fill_small(t: TaskTick[Any]):
    """Rows that keep a quantity small: no reference, and the weights of the block."""
    for a in range(t.rows.b.shape[0]):
        t.rows.b[a], t.rows.weights[a] = 0.0, t.task.weight[a]


@dataclass(frozen=True)
class Task(Part[B]):
    """Base of tasks, see `Part`. Their blocks have gains and a reference.

    `rows` is the specification. `kernel`, of a `TaskTick`, fills the same rows; without one the
    controller calls `rows`, and runs from Python.
    """

    room: ClassVar[str] = str(__package__)
    space: ClassVar[TaskSpace] = TaskSpace.MOTION  #: what it weighs
    size: ClassVar[int]  #: rows of a task of MOTION

    def rows(self, t: TaskInput, block: B) -> Rows:
        """Return its rows in v̇, or in (v̇, w, u_root), in NumPy."""
        raise NotImplementedError


def spring(units: Units, stiffness: float, damping_ratio: float) -> tuple[float, float]:
    """k [1/s²] and d = 2 ζ √k [1/s], from a stiffness in ω² and a damping ratio ζ."""
    k = stiffness * units.omega**2
    return float(k), float(2.0 * damping_ratio * np.sqrt(k))


def task_input(
    state: RobotState,
    targets: Targets | TargetArrays,
    support: RobotState | None = None,
    cop_vel: np.ndarray | None = None,
    torques: np.ndarray | None = None,
) -> TaskInput:
    """Return what the first task reads. By default all soles are in contact, nothing else is, and
    the CoP is at rest."""
    support = support or state
    if torques is None:
        torques = np.hstack([state.M, -support.J.T])[6:]
    force = np.array([0.0, 0.0, state.mass * state.robot.gravity - state.load[0]])
    cop_vel = np.zeros(2) if cop_vel is None else cop_vel
    return TaskInput(state, targets, support, cop_vel, force, torques)


def all_rows(tasks: Iterable[Bound[Task] | Rows], given: TaskInput) -> Iterator[Rows]:
    """The rows of tasks one after the other, each with the force that those before it desire."""
    for task in tasks:
        if isinstance(task, Rows):
            yield task
            continue
        rows: Rows = task.rows(given)
        if task.part.space is TaskSpace.FORCE:
            given = given._replace(force=rows.b + given.state.A_bias[:3])
        yield rows
