"""Further tasks and limits of a reduced problem: which rows are whose."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program, run
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState

from .limits.limit import BoundArrays, Limit, LimitTick, ReducedMotion
from .parts.part import Bound
from .tasks.task import RowArrays, Task, TaskTick
from .workspace import Workspace


@dataclass(frozen=True, eq=False)
class TaskStack(Block):
    """k rows of ½ Σ weights (A v̇ − b)², task below task, for a problem of n unknowns."""

    A: np.ndarray  # (k, nv)
    b: np.ndarray  # (k,)
    weights: np.ndarray  # (k,)
    AV: Annotated[np.ndarray, "k", "n"]  # scratch
    weighted: Annotated[np.ndarray, "k", "n"]  # scratch
    fill: Program  # the kernels of the tasks, each with its rows


def make_stack(tasks: Iterable[Bound[Task]], state: StateArrays, workspace: Workspace) -> TaskStack:
    """The tasks one below the other."""
    tasks = tuple(tasks)
    k, nv, n = sum(task.size for task, _ in tasks), len(state.qvel), len(workspace.g)
    A, b, weights, calls, first = guarded_zeros((k, nv)), guarded_zeros(k), guarded_zeros(k), [], 0
    for task, block in tasks:
        own = slice(first, first + task.size)
        tick = TaskTick(state, block, RowArrays(A[own], b[own], weights[own]))
        if task.kernel is not None:
            calls.append((task.kernel, tick))
        first = own.stop
    return TaskStack.allocate({"k": k, "n": n}, A=A, b=b, weights=weights, fill=Program.of(calls))


def limit_program(
    limits: Iterable[Bound[Limit]], state: StateArrays, workspace: Workspace
) -> Program:
    """Return the kernels of limits, whose rows are the last constraints of the workspace."""
    ws, calls = workspace, []
    sized = [(limit, block, limit.size(block)) for limit, block in limits]
    motion = ReducedMotion(V=ws.V, vdot0=ws.vdot0, T=ws.T, tau0=ws.tau0)
    first = len(ws.l) - sum(size for _, _, size in sized)
    for limit, block, size in sized:
        own = slice(first, first + size)
        rows = BoundArrays(C=ws.C[own], l=ws.l[own], u=ws.u[own])
        calls.append((limit.kernel, LimitTick(state, motion, block, rows)))
        first = own.stop
    return Program.of(calls)


def fill_from_python(stack: TaskStack, tasks: Iterable[Bound[Task]], state: RobotState) -> None:
    """Write the rows of the tasks that have no kernel."""
    first = 0
    for bound in tasks:
        own = slice(first, first + bound.part.size)
        if bound.part.kernel is None:
            stack.A[own], stack.b[own], stack.weights[own] = bound.rows(state)
        first = own.stop


@compiled
def add_stack(stack: TaskStack, ws: Workspace):
    """Add ½ Σ weights (A v̇ − b)², v̇ = v̇₀ + V x, to the objective; kernels fill their rows first."""
    run(stack.fill)
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
