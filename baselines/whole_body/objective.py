"""The compiled objective: the sum of all tasks, and what keeps it strictly convex."""

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays

from .parameters import QPParameters
from .stack import TaskStack, add_stack
from .workspace import Workspace


@compiled
def build_objective(s: StateArrays, p: QPParameters, tasks: TaskStack, ws: Workspace):
    """Fill H and g: ½ the weighted squares of all tasks, whose rows are filled already.

    Tasks of a quantity that the workspace has anyway have their weights and desired values there,
    as contacts other than soles have them of their forces; the rows of the others are in `tasks`.
    """
    n = ws.g.shape[0]
    nz, weights = ws.first_internal, ws.weights
    _copy_rows(ws)
    ws.g[:] = 0.0
    for r in range(weights.shape[0]):
        residual = weights[r] * (ws.offsets[r] - ws.desired[r])
        for j in range(n):
            ws.weighted[r, j] = weights[r] * ws.rows[r, j]
            ws.g[j] += residual * ws.rows[r, j]
    np.dot(ws.rows.T, ws.weighted, ws.H)
    weigh_weakest_row(s, p, ws)
    for i in range(n):
        if i < nz:
            ws.H[i, i] += p.accel_floor
        for j in range(i):
            ws.H[i, j] = ws.H[j, i]
    if tasks.b.shape[0] > 0:
        add_stack(tasks, ws)


@compiled
def _copy_rows(ws: Workspace):
    """Copy the rows of quantities that more than one task weighs."""
    for c in range(ws.copied.shape[0]):
        to, start = ws.copied[c, 0], ws.copied[c, 1]
        for i in range(ws.copied[c, 2]):
            ws.offsets[to + i] = ws.offsets[start + i]
            for j in range(ws.rows.shape[1]):
                ws.rows[to + i, j] = ws.rows[start + i, j]


@compiled
def weigh_weakest_row(s: StateArrays, p: QPParameters, ws: Workspace):
    """Add ½ weight (J v̇ − b)² of the row of J that is no equality, where there is one."""
    if ws.space.spare == 0:
        return
    row, pivot, rest = ws.space.pivot[-1], ws.space.weakest[0], ws.space.weakest[1]
    turns = row < s.J.shape[0] and row % 6 >= 3
    weight = p.weakest_weight[1 if turns else 0]
    ws.H[0, 0] += weight * pivot * pivot
    ws.g[0] -= weight * pivot * rest
