"""The momentum QP with its equalities eliminated: compiled, nothing allocated.

The readable problem of `formulation.py` has the unknowns (v̇, w) and two sets of equalities.
Here both are solved first [Macchietto09, Moskalev24 §2.1]:

    J v̇ = b                        v̇ = v̇₀ + V z           V spans the null space of J
    A v̇ + A_bias = G w (+ u)       w = w₀ + E x           the wrench about the CoM, shared out

With W = A v̇ + A_bias − u the total wrench that the ground must give, each of the nc soles takes
W/nc plus a part y_i of the internal wrenches, which cancel in the sum: so the unknowns are
x = (z, y_1 … y_{nc−1}, u), u only with a soft root; 15 + 6 (+ 6) for a humanoid on two feet.
Torques follow: τ = M v̇ + h − Jᵀw on the joints' rows.
"""

from dataclasses import dataclass

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.baselines.solvers.dual_active_set import iscratch_size, scratch_size
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.maths.vectors import copy, cross
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .null_space import NullSpace, allocate_null_space, solve_soles


@dataclass(frozen=True, eq=False)
class QPParameters(Block):
    """What tasks, contacts and limits hand to the compiled code (nv dofs, nc soles)."""

    accel_weight: np.ndarray  # (nv,) posture
    far_share: float  # of these weights, with the CoM far from c_ref
    far_distance: float  # [m]
    stiffness: np.ndarray  # (nv,) k_t [1/s²]
    damping: np.ndarray  # (nv,) d_t [1/s]
    com_weight: np.ndarray  # (3,) ω_c per N²
    com_stiffness: np.ndarray  # (3,) s_c [1/s²]
    com_damping: np.ndarray  # (3,) d_c [1/s]
    angular_weight: np.ndarray  # (3,) ω_p per (N·m)²
    angular_damping: float  # k_L [1/s]
    cop_stiffness: float  # s_p [1/s²]
    cop_damping: float  # d_p [1/s]
    cop_horizon: float  # [s] over which p̈_des is integrated
    force_weight: float  # per N²
    moment_weight: float  # per (N·m)²
    torque_weight: np.ndarray  # (nv−6,) per (N·m)²
    accel_floor: float  # per (unit of z)²
    sole_damping: float  # k_v [1/s]
    cone: np.ndarray  # (nc, rows, 6) cone · w_sole ≤ 0
    torque_limit: np.ndarray  # (nv−6,) 0 for a joint without a motor
    brake_accel: float  # [rad/s²] that braking may assume
    brake_horizon: float  # [s]
    brake_floor: float  # [rad/s²] braking is never asked to exceed
    soft_root: bool
    root_weight: np.ndarray  # (6,) ω_root per N² and per (N·m)²


@dataclass(frozen=True, eq=False)
class Workspace(Block):
    """Scratch of the reduced problem; `H`, `g`, `C`, `l`, `u` are the QP after `assemble`.

    v̇, the total wrench W, the sole wrenches w and the joint torques τ are affine in x: V x + v̇₀,
    B x + W₀, E x + w₀, T x + τ₀. They lie one below the other in `rows` and `offsets`.
    """

    rows: np.ndarray  # (r, n), r = nv + 6 + k + nj
    offsets: np.ndarray  # (r,)
    wanted: np.ndarray  # (r,) what each should be
    weights: np.ndarray  # (r,) of the squared differences
    weighted: np.ndarray  # (r, n) rows times weights
    values: np.ndarray  # (r,) at the solution
    V: np.ndarray  # (nv, n) a view, like the next seven; columns span the null space of J, or are 0
    B: np.ndarray  # (6, n) A V
    E: np.ndarray  # (k, n)
    T: np.ndarray  # (nj, n)
    vdot0: np.ndarray  # (nv,)
    W0: np.ndarray  # (6,) A v̇₀ + A_bias
    w0: np.ndarray  # (k,)
    tau0: np.ndarray  # (nj,)
    accel_des: np.ndarray  # (nv,) a view of `wanted`
    space: NullSpace
    sole_rhs: np.ndarray  # (k,)
    y: np.ndarray  # (6,)
    cop_prev: np.ndarray  # (2,) last measured p
    cop_vel: np.ndarray  # (2,) ṗ
    momentum_rate: np.ndarray  # (6,) [Ṗ_des; L̇_des]
    BBt: np.ndarray  # (6, 6)
    JtE: np.ndarray  # (nv, n) Jᵀ E
    local: np.ndarray  # (6, n) E of one sole, its own axes
    local0: np.ndarray  # (6,) w₀ of one sole, its own axes
    H: np.ndarray  # (n, n)
    g: np.ndarray  # (n,)
    C: np.ndarray  # (m, n)
    l: np.ndarray  # noqa: E741  (m,)
    u: np.ndarray  # (m,)
    x: np.ndarray  # (n,)
    lam: np.ndarray  # (m,)
    scratch: np.ndarray
    iscratch: np.ndarray
    status: np.ndarray  # (1,) int: how the solution ended, see `solvers/rows.py`; 0: solved
    vdot: np.ndarray  # (nv,) solution, a view of `values` like the next one
    wrenches: np.ndarray  # (k,) solution
    tau: np.ndarray  # (nj,) solution
    root_wrench: np.ndarray  # (6,) solution, about the CoM; zero with a hard root

    @property
    def N(self) -> np.ndarray:
        """(nz, nv) rows span the null space of J: the first columns of V."""
        held, steps = self.space.held, len(self.space.beta)
        return self.V[:, : len(held) - steps + len(self.space.free)].T


def allocate_workspace(robot: RobotArrays, cone_rows: int, soft_root: bool) -> Workspace:
    """Zeroed scratch for one robot, whose wrench cones have `cone_rows` rows each."""
    space = allocate_null_space(robot)
    nj, nc = len(robot.q_standing), len(robot.sole_body)
    nv, k = nj + 6, 6 * nc
    n = nv - len(space.beta) + 6 * (nc - 1) + (6 if soft_root else 0)
    m, r = nc * cone_rows + 2 * nj, nv + 6 + k + nj
    z = apart
    rows, offsets, wanted, values = z((r, n)), z(r), z(r), z(r)
    V, B, E, T = (slice(0, nv), slice(nv, nv + 6), slice(nv + 6, nv + 6 + k), slice(r - nj, r))
    ws = Workspace(
        rows=rows, offsets=offsets, wanted=wanted, weights=z(r),
        weighted=z((r, n)), values=values, V=rows[V], B=rows[B], E=rows[E], T=rows[T],
        vdot0=offsets[V], W0=offsets[B], w0=offsets[E], tau0=offsets[T],
        accel_des=wanted[V], space=space,
        sole_rhs=z(k), y=z(6), cop_prev=z(2), cop_vel=z(2), momentum_rate=z(6),
        BBt=z((6, 6)), JtE=z((nv, n)), local=z((6, n)), local0=z(6),
        H=z((n, n)), g=z(n), C=z((m, n)), l=z(m), u=z(m), x=z(n), lam=z(m),
        scratch=z(scratch_size(n, m)), iscratch=z(iscratch_size(n, m), dtype=np.int64),
        status=z(1, dtype=np.int64),
        vdot=values[V], wrenches=values[E], tau=z(nj), root_wrench=z(6),
    )  # fmt: skip
    ws.cop_prev[:] = np.nan
    return ws


@dataclass(frozen=True, eq=False)
class Assembly(Block):
    """What the reduced problem of a tick is made from, and where it is put."""

    robot: RobotArrays
    state: StateArrays
    parameters: QPParameters
    targets: TargetArrays
    period: float  # [s] between two ticks
    workspace: Workspace


@compiled
def assemble(a: Assembly):
    """Fill `H, g, C, l, u` of the workspace: min ½xᵀHx + gᵀx, l ≤ Cx ≤ u for this tick."""
    robot, s, p, t, ws = a.robot, a.state, a.parameters, a.targets, a.workspace
    desired_accelerations(s, p, t, ws)
    desired_momentum_rate(robot, s, p, t, a.period, ws)
    _eliminate_soles(s, p, ws)
    _share_wrench(s, p, ws)
    _carry_momentum(p, t, ws)
    _torques(s, ws)
    _objective(robot, s, p, t, ws)
    _constraints(robot, s, p, ws)


@compiled
def desired_accelerations(s, p, t, ws):
    """a_ref + k_t (q_ref ⊖ q) + d_t (v_ref − v); the root's orientation error is a rotation."""
    R, D, error = s.root_axes, t.root_axes, ws.y
    trace = 0.0  # of RᵀD; its skew part is axis · sin(angle), in body axes
    for a in range(3):
        i, j = (a + 1) % 3, (a + 2) % 3
        skew = 0.0
        for b in range(3):
            trace += R[b, a] * D[b, a]
            skew += R[b, j] * D[b, i] - R[b, i] * D[b, j]
        error[a] = 0.5 * skew
    sine = np.sqrt(error[0] * error[0] + error[1] * error[1] + error[2] * error[2])
    scale = np.arctan2(sine, 0.5 * (trace - 1.0)) / sine if sine > 1e-9 else 1.0
    for a in range(3):
        ws.accel_des[a] = -p.damping[a] * s.qvel[a]
        ws.accel_des[3 + a] = (
            t.root_acc[a]
            + p.stiffness[3 + a] * scale * error[a]
            + p.damping[3 + a] * (t.root_vel[a] - s.qvel[3 + a])
        )
    for j in range(t.q_ref.shape[0]):
        ws.accel_des[6 + j] = (
            t.a_ref[j]
            + p.stiffness[6 + j] * (t.q_ref[j] - s.qpos[7 + j])
            + p.damping[6 + j] * (t.v_ref[j] - s.qvel[6 + j])
        )


@compiled
def desired_momentum_rate(robot, s, p, t, tick, ws):
    """Ṗ_des from the CoM's PD law; L̇_des = (p_des − c) × (Ṗ_des − m g) − k_L L."""
    for a in range(2):
        if np.isnan(ws.cop_prev[a]):
            ws.cop_prev[a] = s.cop[a]
        ws.cop_vel[a] = (s.cop[a] - ws.cop_prev[a]) / tick
        ws.cop_prev[a] = s.cop[a]
    arm, force = ws.y[0:3], ws.y[3:6]
    for a in range(3):
        ws.momentum_rate[a] = robot.mass * (
            t.com_acc[a]
            + p.com_stiffness[a] * (t.com[a] - s.com[a])
            + p.com_damping[a] * (t.com_vel[a] - s.com_vel[a])
        )
        force[a] = ws.momentum_rate[a]
        arm[a] = -s.com[a]
    force[2] += robot.mass * robot.gravity
    arm[2] += s.origin[2]
    T = p.cop_horizon
    for a in range(2):
        accel = -p.cop_stiffness * (s.cop[a] - t.cop[a]) - p.cop_damping * ws.cop_vel[a]
        arm[a] += s.cop[a] + T * ws.cop_vel[a] + 0.5 * T * T * accel
    cross(arm, force, ws.momentum_rate[3:6])
    for a in range(3):
        ws.momentum_rate[3 + a] -= p.angular_damping * s.momentum[3 + a]


@compiled
def _eliminate_soles(s, p, ws):
    """v̇₀ and V from J v̇ = −k_v J v − J̇ v."""
    for r in range(s.J.shape[0]):
        ws.sole_rhs[r] = -p.sole_damping * s.J_v[r] - s.Jdot_v[r]
    solve_soles(s.J, ws.sole_rhs, ws.space, ws.vdot0, ws.V)


@compiled
def _share_wrench(s, p, ws):
    """B, W₀ and the sole wrenches w = w₀ + E x: W/nc each, plus internal wrenches."""
    nc = s.sole_point.shape[0]
    n = ws.g.shape[0]
    soft = n - 6
    internal = n - 6 * nc if p.soft_root else n - 6 * (nc - 1)  # the first internal wrench in x
    np.dot(s.A, ws.V, ws.B)
    for a in range(6):
        total = s.A_bias[a]
        for j in range(ws.vdot0.shape[0]):
            total += s.A[a, j] * ws.vdot0[j]
        ws.W0[a] = total
    share = 1.0 / nc
    for i in range(nc):
        E, w0 = ws.E[6 * i : 6 * i + 6], ws.w0[6 * i : 6 * i + 6]
        for a in range(6):
            w0[a] = share * ws.W0[a]
            for j in range(n):
                E[a, j] = share * ws.B[a, j]
            if i < nc - 1:
                E[a, internal + 6 * i + a] = 1.0
            else:
                for other in range(nc - 1):
                    E[a, internal + 6 * other + a] = -1.0
            if p.soft_root:
                E[a, soft + a] = -share
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
def _carry_momentum(p, t, ws):
    """Posture velocities that carry L_ref: a_des += d_t V z, the least z with B z = [0; L_ref].

    The soles and the CoM stay where they are (A_P V z = 0), so this asks the trunk and arms to
    turn, which is what the posture's own damping holds back.
    """
    L = t.angular_momentum
    if L[0] == 0.0 and L[1] == 0.0 and L[2] == 0.0:
        return
    nv = ws.V.shape[0]
    nz = nv - ws.space.beta.shape[0]
    G, y = ws.BBt, ws.y
    trace = 0.0
    for a in range(6):
        for b in range(6):
            total = 0.0
            for i in range(nz):
                total += ws.B[a, i] * ws.B[b, i]
            G[a, b] = total
        trace += G[a, a]
        y[a] = L[a - 3] if a >= 3 else 0.0
    for a in range(6):  # a robot of few joints may not reach every direction
        G[a, a] += 1e-9 * trace
    for k in range(6):  # Gauss: G is symmetric positive definite
        for a in range(k + 1, 6):
            factor = G[a, k] / G[k, k]
            for b in range(k, 6):
                G[a, b] -= factor * G[k, b]
            y[a] -= factor * y[k]
    for a in range(5, -1, -1):
        for b in range(a + 1, 6):
            y[a] -= G[a, b] * y[b]
        y[a] /= G[a, a]
    for i in range(nz):
        z = 0.0
        for a in range(6):
            z += ws.B[a, i] * y[a]
        for j in range(3, nv):
            ws.accel_des[j] += p.damping[j] * ws.V[j, i] * z


@compiled
def _torques(s, ws):
    """τ = τ₀ + T x on every joint's row of M v̇ + h − Jᵀw."""
    nj, n = ws.T.shape
    np.dot(s.M[6:], ws.V, ws.T)
    np.dot(s.J.T, ws.E, ws.JtE)
    for a in range(nj):
        total = s.h[6 + a]
        for j in range(ws.vdot0.shape[0]):
            total += s.M[6 + a, j] * ws.vdot0[j]
        ws.tau0[a] = total
        for j in range(n):
            ws.T[a, j] -= ws.JtE[6 + a, j]
    for r in range(ws.w0.shape[0]):
        for a in range(nj):
            ws.tau0[a] -= s.J[r, 6 + a] * ws.w0[r]


@compiled
def tracking_share(s, p, t):
    """β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally: what the posture's weights keep."""
    x, y = s.com[0] - t.com[0], s.com[1] - t.com[1]
    away = (x * x + y * y) / (p.far_distance * p.far_distance)
    return p.far_share + (1.0 - p.far_share) * np.exp(-away)


@compiled
def _objective(robot, s, p, t, ws):
    """½ the weighted squares: posture, Ṗ, L̇, and small costs of wrenches, torques and x."""
    nv, n = ws.V.shape
    nz = nv - ws.space.beta.shape[0]
    weights, wanted = ws.weights, ws.wanted  # which holds the posture's accelerations already
    share = tracking_share(s, p, t)
    for j in range(nv):
        weights[j] = share * p.accel_weight[j]
    for a in range(3):
        weights[nv + a], weights[nv + 3 + a] = p.com_weight[a], p.angular_weight[a]
        wanted[nv + a], wanted[nv + 3 + a] = ws.momentum_rate[a], ws.momentum_rate[3 + a]
    wanted[nv + 2] += robot.mass * robot.gravity
    first = nv + 6
    for r in range(ws.w0.shape[0]):
        weights[first + r] = p.force_weight if r % 6 < 3 else p.moment_weight
    first += ws.w0.shape[0]
    for a in range(ws.tau0.shape[0]):
        weights[first + a] = p.torque_weight[a]
    ws.g[:] = 0.0
    for r in range(weights.shape[0]):
        residual = weights[r] * (ws.offsets[r] - wanted[r])
        for j in range(n):
            ws.weighted[r, j] = weights[r] * ws.rows[r, j]
            ws.g[j] += residual * ws.rows[r, j]
    np.dot(ws.rows.T, ws.weighted, ws.H)
    if p.soft_root:
        for i in range(6):
            ws.H[n - 6 + i, n - 6 + i] += p.root_weight[i]
    for i in range(n):
        if i < nz:
            ws.H[i, i] += p.accel_floor
        for j in range(i):
            ws.H[i, j] = ws.H[j, i]


@compiled
def _constraints(robot, s, p, ws):
    """Rows of C: wrench cones, torque limits, joint limits by braking distance."""
    nc, rows = p.cone.shape[0], p.cone.shape[1]
    nj, m = ws.T.shape[0], nc * p.cone.shape[1]
    for i in range(nc):
        axes, first = s.sole_axes[i], i * rows
        for a in range(6):
            r, c = 6 * i + a // 3 * 3, a % 3  # of the force or the moment; the sole's axis
            x, y, z = axes[0, c], axes[1, c], axes[2, c]
            ws.local0[a] = x * ws.w0[r] + y * ws.w0[r + 1] + z * ws.w0[r + 2]
            for j in range(ws.local.shape[1]):
                ws.local[a, j] = x * ws.E[r, j] + y * ws.E[r + 1, j] + z * ws.E[r + 2, j]
        np.dot(p.cone[i], ws.local, ws.C[first : first + rows])
        for r in range(rows):
            total = 0.0
            for a in range(6):
                total += p.cone[i, r, a] * ws.local0[a]
            ws.l[first + r], ws.u[first + r] = -np.inf, -total
    for a in range(nj):
        copy(ws.T[a], ws.C[m + a])
        copy(ws.V[6 + a], ws.C[m + nj + a])
        ws.l[m + a] = -p.torque_limit[a] - ws.tau0[a]
        ws.u[m + a] = p.torque_limit[a] - ws.tau0[a]
        low, high = braking_bounds(
            s.qpos[7 + a], s.qvel[6 + a], robot.q_min[a], robot.q_max[a],
            p.brake_accel, p.brake_horizon, p.brake_floor,
        )  # fmt: skip
        ws.l[m + nj + a], ws.u[m + nj + a] = low - ws.vdot0[6 + a], high - ws.vdot0[6 + a]


@compiled
def braking_bounds(q, v, q_min, q_max, accel, horizon, floor):
    """Bounds on q̈ that let a joint stop before its limit.

    The bound brings v within `horizon` to the fastest velocity from which `accel` still stops in
    the distance left (see `stopping_speed`), asking for no more than `floor`.
    """
    low, high = -np.inf, np.inf
    if q_max < np.inf:
        high = max((stopping_speed(q_max - q, accel, horizon) - v) / horizon, -floor)
    if q_min > -np.inf:
        low = min((-stopping_speed(q - q_min, accel, horizon) - v) / horizon, floor)
    return low, max(low, high)


@compiled
def stopping_speed(distance, accel, horizon):
    """Speed v that stops within a distance after a reaction time r: r v + v²/(2 accel) = distance.

    r = 4·horizon makes the way to the limit critically damped: no overshoot. Beyond the limit the
    speed leads back to it.
    """
    reaction = 4.0 * horizon
    if distance < 0.0:
        return distance / reaction
    lag = reaction * accel
    return np.sqrt(lag * lag + 2.0 * accel * distance) - lag


@compiled
def recover(p: QPParameters, ws: Workspace):
    """Accelerations, wrenches and torques from the solution x."""
    n, nj = ws.g.shape[0], ws.tau.shape[0]
    np.dot(ws.rows, ws.x, ws.values)
    for r in range(ws.values.shape[0]):
        ws.values[r] += ws.offsets[r]
    first = ws.values.shape[0] - nj
    for a in range(nj):
        ws.tau[a] = min(max(ws.values[first + a], -p.torque_limit[a]), p.torque_limit[a])
    for a in range(6):
        ws.root_wrench[a] = ws.x[n - 6 + a] if p.soft_root else 0.0
