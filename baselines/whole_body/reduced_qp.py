"""The momentum QP with its equalities eliminated: compiled, nothing allocated.

The readable problem of `formulation.py` has the unknowns (v̇, w) and two sets of equalities.
Here both are solved first [Macchietto09, Moskalev24 §2.1]:

    J v̇ = b                        v̇ = v̇₀ + V z           V spans the null space of J
    A v̇ + A_bias = G w (+ u)       w = w₀ + E x           the wrench about the CoM, shared out

With W = A v̇ + A_bias − u − Σ G_p f_p the total wrench that the soles must give, f_p the forces of
other contacts, each of the nc soles takes W/nc plus a part y_i of the internal wrenches, which
cancel in the sum: so the unknowns are x = (z, y_1 … y_{nc−1}, f, u), u only with a soft root;
15 + 6 (+ 6) for a humanoid on two feet. Torques follow: τ = M v̇ + h − Jᵀw on the joints' rows.
"""

from dataclasses import dataclass

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.baselines.solvers.null_space import solve_resting
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program, run
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays, borne_weight

from .constraints import build_constraints
from .contacts.contact import ContactArrays
from .objective import build_objective
from .parameters import QPParameters
from .stack import TaskStack
from .workspace import Workspace


@dataclass(frozen=True, eq=False)
class Assembly(Block):
    """All that the reduced problem of a tick is made from, and its workspace."""

    robot: RobotArrays
    state: StateArrays
    contacts: ContactArrays
    parameters: QPParameters
    targets: TargetArrays  # of the tasks
    period: float  # [s] between two ticks
    tasks: TaskStack
    limits: Program  # the kernels of further limits, see `limits/`
    workspace: Workspace


@compiled
def assemble(a: Assembly):
    """Fill `H, g, C, l, u` of the workspace: min ½xᵀHx + gᵀx, l ≤ Cx ≤ u for this tick."""
    robot, s, c, p, ws = a.robot, a.state, a.contacts, a.parameters, a.workspace
    _measure(robot, s, a.period, ws)
    _update_contacts(s, c)
    _eliminate_contacts(s, c, p, ws)
    _distribute_wrench(s, c, p, ws)
    _torques(s, c, ws)
    run(a.tasks.fill)
    build_objective(s, p, a.tasks, ws)
    build_constraints(robot, s, p, c, ws)
    run(a.limits)


@compiled
def _measure(robot: RobotArrays, s: StateArrays, period: float, ws: Workspace):
    """Fill ṗ, the difference between two ticks, and the force that bears the robot at rest."""
    for a in range(2):
        if np.isnan(ws.cop_prev[a]):
            ws.cop_prev[a] = s.cop[a]
        ws.cop_vel[a] = (s.cop[a] - ws.cop_prev[a]) / period
        ws.cop_prev[a] = s.cop[a]
    ws.force[2] = borne_weight(robot, s)


@compiled
def _update_contacts(s: StateArrays, c: ContactArrays):
    """Fill J of the soles and the points, and the rows of the points; without points J is s.J."""
    if c.positions.shape[0] > 0:
        for r in range(s.J.shape[0]):
            copy_into(s.J[r], c.J[r])
        run(c.fill)


@compiled
def _eliminate_contacts(s: StateArrays, c: ContactArrays, p: QPParameters, ws: Workspace):
    """Solve J v̇ = a − k_v J v − J̇ v of the soles and of the points for v̇₀ and V; a is zero but for
    a swing foot's sole."""
    for r in range(s.J.shape[0]):
        ws.contact_accel[r] = ws.sole_accel[r] - p.sole_damping * s.J_v[r] - s.Jdot_v[r]
    solve_resting(c.J, ws.contact_accel, ws.space, ws.vdot0, ws.V)


@compiled
def _distribute_wrench(s: StateArrays, c: ContactArrays, p: QPParameters, ws: Workspace):
    """Fill B, W₀ and the sole wrenches w = w₀ + E x: W/nc each, plus internal wrenches."""
    nc = s.sole_point.shape[0]
    n = ws.g.shape[0]
    soft, internal = ws.first_root, ws.first_internal
    np.dot(s.A, ws.V, ws.B)
    for a in range(6):
        total = s.A_bias[a]
        for j in range(ws.vdot0.shape[0]):
            total += s.A[a, j] * ws.vdot0[j]
        ws.W0[a] = total
    part = 1.0 / nc
    for i in range(nc):
        E, w0 = ws.E[6 * i : 6 * i + 6], ws.w0[6 * i : 6 * i + 6]
        for a in range(6):
            w0[a] = part * ws.W0[a]
            for j in range(n):
                E[a, j] = part * ws.B[a, j]
            if i < nc - 1:
                E[a, internal + 6 * i + a] = 1.0
            else:
                for other in range(nc - 1):
                    E[a, internal + 6 * other + a] = -1.0
            if p.soft_root:
                E[a, soft + a] = -part
        for k in range(c.positions.shape[0]):
            _take_force(c.positions[k], s.com, part, ws.first_force + 3 * k, E)
        # about the CoM → about the sole: the force's moment over the arm is subtracted
        rx = s.sole_point[i, 0] - s.com[0]
        ry = s.sole_point[i, 1] - s.com[1]
        rz = s.sole_point[i, 2] - s.com[2]
        w0[3] -= ry * w0[2] - rz * w0[1]
        w0[4] -= rz * w0[0] - rx * w0[2]
        w0[5] -= rx * w0[1] - ry * w0[0]
        for j in range(n):
            fx, fy, fz = E[0, j], E[1, j], E[2, j]
            E[3, j] -= ry * fz - rz * fy
            E[4, j] -= rz * fx - rx * fz
            E[5, j] -= rx * fy - ry * fx


@compiled
def _take_force(position: np.ndarray, com: np.ndarray, part: float, first: int, E: np.ndarray):
    """Take a part of [f; (r − c) × f] off a sole's wrench; f are the unknowns from `first` on."""
    rx, ry, rz = position[0] - com[0], position[1] - com[1], position[2] - com[2]
    for a in range(3):
        E[a, first + a] = -part
    E[3, first + 1], E[3, first + 2] = part * rz, -part * ry
    E[4, first], E[4, first + 2] = -part * rz, part * rx
    E[5, first], E[5, first + 1] = part * ry, -part * rx


@compiled
def _torques(s: StateArrays, c: ContactArrays, ws: Workspace):
    """Fill τ = τ₀ + T x, every joint's row of M v̇ + h − Jᵀw."""
    nj, n = ws.T.shape
    np.dot(s.M[6:], ws.V, ws.T)
    np.dot(c.J.T, ws.E, ws.JtE)
    for a in range(nj):
        total = s.h[6 + a]
        for j in range(ws.vdot0.shape[0]):
            total += s.M[6 + a, j] * ws.vdot0[j]
        ws.tau0[a] = total
        for j in range(n):
            ws.T[a, j] -= ws.JtE[6 + a, j]
    for r in range(ws.w0.shape[0]):
        for a in range(nj):
            ws.tau0[a] -= c.J[r, 6 + a] * ws.w0[r]


@compiled
def recover(p: QPParameters, ws: Workspace):
    """Compute accelerations, wrenches and torques from the solution x."""
    np.dot(ws.rows, ws.x, ws.values)
    for r in range(ws.values.shape[0]):
        ws.values[r] += ws.offsets[r]
    for a in range(ws.tau.shape[0]):
        ws.tau[a] = min(max(ws.tau_asked[a], -p.torque_limit[a]), p.torque_limit[a])
    for a in range(6):
        ws.root_wrench[a] = ws.x[ws.first_root + a] if p.soft_root else 0.0
