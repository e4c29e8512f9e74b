"""The momentum QP as the papers write it: nothing eliminated, nothing compiled, pure functions.

    min over x = (v̇, w, u_root)   ½ Σ weight (A x − b)²        rows of the tasks
    s.t.   M v̇ + h = Sᵀτ + Jᵀw + u_root                        dynamics; the six root rows bind
           J v̇ + J̇ v = −k_v J v                                soles do not move
           cone · w ≤ 0,  |τ| ≤ τ_max,  v̇ within what joint limits leave

with τ = M v̇ + h − Jᵀw on the joints' rows; u_root only with a soft root [Moskalev24 §2.1,
Macchietto09]. w are the wrenches of the soles, then the forces of other points in contact.
`MomentumQP` solves the same problem, compiled and with the equalities eliminated (`reduced_qp.py`),
and is tested against this one. To try another task or limit, hand its rows to `build`:

    tasks = [*controller.tasks.values(), Rows(A, b, weights)]
    qp = build(state, targets, controller.parameters, tasks)
    solution = make_solver("active-set").solve(qp)
    torques = torques_of(state, solution.x)
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.solvers import QP
from poise.envs.physics.state import RobotState

from .constraint_rows import (
    contact_jacobian,
    contact_motion,
    joint_limits,
    point_cones,
    root_dynamics,
    sole_cones,
    torque_limits,
    torque_matrix,
)
from .contacts.contact import ContactRows
from .limits.limit import Bounds, Limit
from .parameters import QPParameters
from .parts.part import Bound
from .tasks.task import Rows, Task, all_rows, task_input


class Unknowns(NamedTuple):
    """The parts of x: accelerations, sole wrenches, and a soft root's wrench about the CoM."""

    vdot: np.ndarray  # (nv,)
    w: np.ndarray  # (k,) world axes: force, moment at the sole points, then forces of points
    u_root: np.ndarray  # (6,) world axes: force, moment; zero with a hard root


def unknowns(state: RobotState, x: np.ndarray, points: Sequence[ContactRows] = ()) -> Unknowns:
    """x taken apart."""
    nv, k = len(state.qvel), len(state.J) + 3 * len(points)
    root = x[nv + k :] if len(x) > nv + k else np.zeros(6)
    return Unknowns(x[:nv], x[nv : nv + k], root)


def torques_of(state: RobotState, x: np.ndarray, points: Sequence[ContactRows] = ()) -> np.ndarray:
    """(nv−6,) joint torques τ = (M v̇ + h − Jᵀw) on the joints' rows [N·m]."""
    vdot, w, _ = unknowns(state, x, points)
    return (state.M @ vdot + state.h - contact_jacobian(state, points).T @ w)[6:]


def build(
    state: RobotState,
    targets: Targets,
    parameters: QPParameters,
    tasks: Iterable[Bound[Task] | Rows],
    cop_vel: np.ndarray | None = None,
    constraints: Sequence[Bounds] = (),
    points: Sequence[ContactRows] = (),
    limits: Iterable[Bound[Limit]] = (),
) -> QP:
    """The QP of one tick in x = (v̇, w) or (v̇, w, u_root).

    Args:
        parameters: numbers of contacts and limits: `MomentumQP.parameters`, or `qp_parameters`.
        tasks: the objective, such as `controller.tasks.values()`, with rows of your own or without.
        cop_vel: (2,) ṗ, which a controller measures between its ticks; at rest if left out.
        constraints: further ones.
        points: contacts of other bodies: `[c.rows(state) for c in controller.contacts.values()]`.
        limits: such as `controller.limits.values()`.
    """
    p = parameters
    motion, weakest = contact_motion(state, p, points)
    torques = torque_matrix(state, points)
    given = task_input(state, targets, cop_vel=cop_vel, torques=torques)
    terms = [
        *all_rows(tasks, given),
        *point_loads(state, points),
        weakest,
        least_accelerations(state, p),
        # Zero wherever the soles do not move, so it changes no solution; but H becomes positive
        # definite even if no task weighs the root's linear acceleration.
        Rows(motion.C, motion.l, np.full(len(motion.l), 100.0 / state.robot.units.omega**4)),
    ]
    bounds = [
        root_dynamics(state, p, points),
        motion,
        sole_cones(state, p),
        torque_limits(state, p, points),
        *([joint_limits(state, p)] if p.brakes else []),
        *(limit.rows(state, torques) for limit in limits),
        *constraints,
    ]
    if points:
        bounds.append(point_cones(state, points))
    return sum_up(terms, bounds, torques.shape[1] + (6 if p.soft_root else 0))


def point_loads(state: RobotState, points: Sequence[ContactRows]) -> list[Rows]:
    """½ Σ weights (f − f_des)² of each point in contact."""
    first = len(state.qvel) + len(state.J)
    starts = range(first, first + 3 * len(points), 3)
    return [
        Rows(np.eye(3, start + 3, start), point.force, point.weights)
        for start, point in zip(starts, points, strict=True)
    ]


def least_accelerations(state: RobotState, p: QPParameters) -> Rows:
    """Small accelerations: ‖v̇‖², a trace that keeps the compiled problem well posed."""
    nv = len(state.qvel)
    return Rows(np.eye(nv), np.zeros(nv), np.full(nv, p.accel_floor))


def sum_up(tasks: Sequence[Rows], constraints: Sequence[Bounds], n: int) -> QP:
    """H = Σ Aᵀ W A, g = −Σ Aᵀ W b, and the constraints one below the other, for n unknowns."""
    H, g = np.zeros((n, n)), np.zeros(n)
    for task in tasks:
        A = np.pad(task.A, ((0, 0), (0, n - task.A.shape[1])))
        weighted = task.weights[:, None] * A
        H += A.T @ weighted
        g -= task.b @ weighted
    C = np.vstack([np.pad(each.C, ((0, 0), (0, n - each.C.shape[1]))) for each in constraints])
    l = np.concatenate([bounds.l for bounds in constraints])  # noqa: E741
    u = np.concatenate([bounds.u for bounds in constraints])
    return QP(0.5 * (H + H.T), g, C, l, u)
