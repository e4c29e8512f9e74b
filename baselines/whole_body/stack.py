"""The tasks and further limits of a reduced problem: which rows are whose."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.configs.errors import ConfigError
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.kinematics import StateArrays

from .limits.limit import BoundArrays, Limit, LimitTick
from .parts.part import Bound
from .parts.reduced_motion import ReducedMotion
from .tasks.task import RowArrays, Task, TaskInput, TaskSpace, TaskTick, all_rows
from .workspace import Workspace


@dataclass(frozen=True, eq=False)
class TaskStack(Block):
    """All tasks: k rows of ½ Σ weights (A v̇ − b)², task below task, for n unknowns.

    Tasks of other quantities than A v̇ have their rows in the workspace.
    """

    A: np.ndarray  # (k, nv)
    b: np.ndarray  # (k,)
    weights: np.ndarray  # (k,)
    AV: Annotated[np.ndarray, "k", "n"]  # scratch
    weighted: Annotated[np.ndarray, "k", "n"]  # scratch
    fill: Program  # the kernels of all tasks, each with its rows


def copies(tasks: Iterable[Bound[Task]]) -> list[TaskSpace]:
    """Return the quantities that tasks weigh again, in their order; the first has them as they are.

    So one task of each is no copy, and costs no more rows.
    """
    seen = [task.space for task, _ in tasks if task.space is not TaskSpace.MOTION]
    return [quantity for i, quantity in enumerate(seen) if quantity in seen[:i]]


def make_stack(
    tasks: Iterable[Bound[Task]],
    state: StateArrays,
    targets: TargetArrays,
    support: StateArrays,
    workspace: Workspace,
) -> TaskStack:
    """The tasks in their order; those after one that weighs FORCE read what it desires.

    Raises ConfigError for a quantity that `workspace` has no copy of for one more task.

    Args:
        state: with all soles.
        support: with the soles in contact.
    """
    tasks, ws, nv = tuple(tasks), workspace, len(workspace.vdot0)
    k = sum(task.size for task, _ in tasks if task.space is TaskSpace.MOTION)
    A, b, weights = guarded_zeros((k, nv)), guarded_zeros(k), guarded_zeros(k)
    motion, no_matrix = reduced_motion(ws), guarded_zeros((0, nv))
    force, first, seen, free = ws.force, 0, set(), iter(ws.copied)
    calls = []
    for task, block in tasks:
        if task.space is TaskSpace.MOTION:
            own = slice(first, first + task.size)
            rows, first = RowArrays(A[own], b[own], weights[own]), own.stop
        else:
            own = ws.part(task.space) if task.space not in seen else _copied(free, task)
            rows = RowArrays(no_matrix, ws.desired[own], ws.weights[own])
            seen.add(task.space)
        tick = TaskTick(state, targets, support, ws.cop_vel, force, motion, block, rows)
        calls.append((task.kernel or from_python, tick))
        if task.space is TaskSpace.FORCE:
            force = rows.b
    sizes = {"k": k, "n": len(ws.g)}
    return TaskStack.allocate(sizes, A=A, b=b, weights=weights, fill=Program.of(calls))


def _copied(free: Iterator[np.ndarray], task: Task) -> slice:
    """The rows of the next copy."""
    if (copy := next(free, None)) is None:
        raise ConfigError(
            f"no rows are left for one more task of {task.space.value}", field="tasks"
        )
    return slice(int(copy[0]), int(copy[0] + copy[2]))


def reduced_motion(ws: Workspace) -> ReducedMotion:
    """The motion in the unknowns of a workspace."""
    return ReducedMotion(
        V=ws.V, vdot0=ws.vdot0, B=ws.B, T=ws.T, tau0=ws.tau0,
        first=ws.space.spare, last=ws.first_internal,
    )  # fmt: skip


@compiled
def from_python(t: TaskTick):
    """Leave the rows as `fill_from_python` has filled them."""


def fill_from_python(stack: TaskStack, tasks: Sequence[Bound[Task]], given: TaskInput) -> None:
    """Write the rows of the tasks that have no kernel."""
    state, blocks = given.state, stack.fill.blocks()
    bias = {
        TaskSpace.FORCE: state.A_bias[:3],
        TaskSpace.MOMENT: state.A_bias[3:],
        TaskSpace.TORQUES: state.h[6:],
    }
    for (task, _), tick, rows in zip(tasks, blocks, all_rows(tasks, given), strict=True):
        if task.kernel is None:
            if task.space is TaskSpace.MOTION:
                tick.rows.A[:] = rows.A
            tick.rows.b[:], tick.rows.weights[:] = rows.b + bias.get(task.space, 0.0), rows.weights


def exchange_targets(stack: TaskStack, targets: TargetArrays) -> None:
    """Let the tasks read other targets from now on."""
    for tick in stack.fill.blocks():
        tick.replace_block("targets", targets)


def limit_program(
    limits: Iterable[Bound[Limit]], state: StateArrays, workspace: Workspace
) -> Program:
    """Return the kernels of limits, whose rows are the last constraints of the workspace."""
    ws, calls = workspace, []
    sized = [(limit, block, limit.size(block)) for limit, block in limits]
    motion = reduced_motion(ws)
    first = len(ws.l) - sum(size for _, _, size in sized)
    for limit, block, size in sized:
        own = slice(first, first + size)
        rows = BoundArrays(C=ws.C[own], l=ws.l[own], u=ws.u[own])
        calls.append((limit.kernel, LimitTick(state, motion, block, rows)))
        first = own.stop
    return Program.of(calls)


@compiled
def add_stack(stack: TaskStack, ws: Workspace):
    """Add ½ Σ weights (A v̇ − b)², v̇ = v̇₀ + V x, to the objective."""
    A, AV = stack.A, stack.AV
    np.dot(A, ws.V, AV)
    for r in range(A.shape[0]):
        offset = -stack.b[r]
        for j in range(A.shape[1]):
            offset += A[r, j] * ws.vdot0[j]
        for i in range(AV.shape[1]):
            stack.weighted[r, i] = stack.weights[r] * AV[r, i]
            ws.g[i] += offset * stack.weighted[r, i]
    n = AV.shape[1]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for r in range(A.shape[0]):
                total += AV[r, i] * stack.weighted[r, j]
            ws.H[i, j] += total
