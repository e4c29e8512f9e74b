"""The momentum QP with its equalities eliminated: compiled, nothing allocated.

The readable problem of `formulation.py` has the unknowns (v̇, w) and two sets of equalities.
Here both are solved first [Macchietto09, Moskalev24 §2.1]:

    J v̇ = b                        v̇ = v̇₀ + N z           N spans the null space of J
    A v̇ + A_bias = G w (+ u)       w = w₀ + E x           the wrench about the CoM, shared out

With W = A v̇ + A_bias − u the total wrench that the ground must give, each of the nc soles takes
W/nc plus a part y_i of the internal wrenches, which cancel in the sum: so the unknowns are
x = (z, y_1 … y_{nc−1}, u), u only with a soft root; 15 + 6 (+ 6) for a humanoid on two feet.
Torques follow: τ = M v̇ + h − Jᵀw on the joints' rows.
"""

from typing import NamedTuple

import numpy as np

from poise.envs.arrays import RobotArrays, apart
from poise.envs.jit import compiled
from poise.envs.kinematics import StateArrays, cross

from .solvers.dual_active_set import iscratch_size, scratch_size


class QPParameters(NamedTuple):
    """What tasks, contacts and limits hand to the compiled code (nv dofs, nc soles)."""

    accel_weight: np.ndarray  # (nv,) posture
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


class TargetArrays(NamedTuple):
    """What the controller is asked to reach (nj = nv−6 joints), world axes."""

    q_ref: np.ndarray  # (nj,)
    v_ref: np.ndarray  # (nj,)
    a_ref: np.ndarray  # (nj,)
    root_axes: np.ndarray  # (3, 3) desired root orientation
    root_vel: np.ndarray  # (3,) desired angular velocity of the root, body axes
    root_acc: np.ndarray  # (3,)
    com: np.ndarray  # (3,) c_ref
    com_vel: np.ndarray  # (3,)
    com_acc: np.ndarray  # (3,)
    cop: np.ndarray  # (2,) p_ref
    angular_momentum: np.ndarray  # (3,) L_ref that the posture is to carry; zero: none


class Workspace(NamedTuple):
    """Scratch of the reduced problem; `H`, `g`, `C`, `l`, `u` are the QP after `assemble`."""

    reflectors: np.ndarray  # (k, nv) rows: Householder vectors below, R above the diagonal
    diagonal: np.ndarray  # (k,)
    beta: np.ndarray  # (k,)
    pivot: np.ndarray  # (k,) int
    sole_rhs: np.ndarray  # (k,)
    y: np.ndarray  # (nv,)
    N: np.ndarray  # (nz, nv) rows span the null space of J
    weighted: np.ndarray  # (nv,)
    accel_des: np.ndarray  # (nv,)
    vdot0: np.ndarray  # (nv,)
    cop_prev: np.ndarray  # (2,) last measured p
    cop_vel: np.ndarray  # (2,) ṗ
    momentum_rate: np.ndarray  # (6,) [Ṗ_des; L̇_des]
    B: np.ndarray  # (6, nz) A N
    W0: np.ndarray  # (6,) A v̇₀ + A_bias
    BBt: np.ndarray  # (6, 6)
    E: np.ndarray  # (k, n)
    w0: np.ndarray  # (k,)
    T: np.ndarray  # (nj, n)
    tau0: np.ndarray  # (nj,)
    H: np.ndarray  # (n, n)
    g: np.ndarray  # (n,)
    C: np.ndarray  # (m, n)
    l: np.ndarray  # noqa: E741  (m,)
    u: np.ndarray  # (m,)
    x: np.ndarray  # (n,)
    lam: np.ndarray  # (m,)
    scratch: np.ndarray
    iscratch: np.ndarray
    vdot: np.ndarray  # (nv,) solution
    wrenches: np.ndarray  # (k,) solution
    tau: np.ndarray  # (nj,) solution
    root_wrench: np.ndarray  # (6,) solution, about the CoM; zero with a hard root


def allocate_workspace(nv: int, nc: int, cone_rows: int, soft_root: bool) -> Workspace:
    """Zeroed scratch for `nv` degrees of freedom on `nc` soles."""
    k, nj = 6 * nc, nv - 6
    nz = nv - k
    n = nz + 6 * (nc - 1) + (6 if soft_root else 0)
    m = nc * cone_rows + 2 * nj
    z = apart
    ws = Workspace(
        reflectors=z((k, nv)), diagonal=z(k), beta=z(k), pivot=z(k, dtype=np.int64),
        sole_rhs=z(k), y=z(nv), N=z((nz, nv)), weighted=z(nv), accel_des=z(nv), vdot0=z(nv),
        cop_prev=z(2), cop_vel=z(2), momentum_rate=z(6), B=z((6, nz)), W0=z(6),
        BBt=z((6, 6)),
        E=z((k, n)), w0=z(k), T=z((nj, n)), tau0=z(nj), H=z((n, n)), g=z(n), C=z((m, n)),
        l=z(m), u=z(m), x=z(n), lam=z(m), scratch=z(scratch_size(n, m)),
        iscratch=z(iscratch_size(n, m), dtype=np.int64), vdot=z(nv), wrenches=z(k), tau=z(nj),
        root_wrench=z(6),
    )  # fmt: skip
    ws.cop_prev[:] = np.nan
    return ws


@compiled
def assemble(
    robot: RobotArrays,
    s: StateArrays,
    p: QPParameters,
    t: TargetArrays,
    tick: float,
    ws: Workspace,
):
    """Fill `H, g, C, l, u` of `ws` with min ½xᵀHx + gᵀx, l ≤ Cx ≤ u for this tick."""
    desired_accelerations(s, p, t, ws)
    desired_momentum_rate(robot, s, p, t, tick, ws)
    _eliminate_soles(s, p, ws)
    _share_wrench(s, p, ws)
    _carry_momentum(p, t, ws)
    _torques(s, ws)
    _objective(robot, s, p, ws)
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
    """v̇₀ and N from J v̇ = −k_v J v − J̇ v by Householder QR of Jᵀ with column pivoting.

    Rows of `reflectors` are columns of Jᵀ, so that inner loops run over contiguous memory. Rows
    of J that depend on others (a straight leg) are dropped: their part of v̇₀ is zero.
    """
    W, nv = ws.reflectors, s.J.shape[1]
    k = s.J.shape[0]
    for r in range(k):
        ws.sole_rhs[r] = -p.sole_damping * s.J_v[r] - s.Jdot_v[r]
        ws.pivot[r] = r
        W[r, :] = s.J[r, :]
    for r in range(k):
        best, norm2 = r, -1.0
        for c in range(r, k):
            total = 0.0
            for i in range(r, nv):
                total += W[c, i] * W[c, i]
            if total > norm2 * (1.0 + 1e-9):
                best, norm2 = c, total
        if best != r:
            ws.pivot[r], ws.pivot[best] = ws.pivot[best], ws.pivot[r]
            for i in range(nv):
                W[r, i], W[best, i] = W[best, i], W[r, i]
        v = W[r]
        alpha = -np.sqrt(norm2) if v[r] > 0.0 else np.sqrt(norm2)
        length2 = 2.0 * (norm2 - alpha * v[r])
        ws.diagonal[r] = alpha
        v[r] -= alpha
        ws.beta[r] = 2.0 / length2 if length2 > 0.0 else 0.0
        for c in range(r + 1, k):
            total = 0.0
            for i in range(r, nv):
                total += v[i] * W[c, i]
            total *= ws.beta[r]
            for i in range(r, nv):
                W[c, i] -= total * v[i]
    y = ws.y
    y[:] = 0.0
    smallest = 1e-6 * abs(ws.diagonal[0])
    for r in range(k):
        total = ws.sole_rhs[ws.pivot[r]]
        for i in range(r):
            total -= W[r, i] * y[i]
        y[r] = total / ws.diagonal[r] if abs(ws.diagonal[r]) > smallest else 0.0
    ws.vdot0[:] = y
    _apply_reflectors(W, ws.beta, ws.vdot0)
    for i in range(nv - k):
        ws.N[i, :] = 0.0
        ws.N[i, k + i] = 1.0
        _apply_reflectors(W, ws.beta, ws.N[i])


@compiled
def _apply_reflectors(W, beta, vector):
    """vector ← Q vector."""
    for r in range(W.shape[0] - 1, -1, -1):
        total = 0.0
        for i in range(r, W.shape[1]):
            total += W[r, i] * vector[i]
        total *= beta[r]
        for i in range(r, W.shape[1]):
            vector[i] -= total * W[r, i]


@compiled
def _share_wrench(s, p, ws):
    """B, W₀ and the sole wrenches w = w₀ + E x: W/nc each, plus internal wrenches."""
    nz, nv = ws.N.shape
    nc = s.sole_point.shape[0]
    n = ws.g.shape[0]
    for a in range(6):
        total = s.A_bias[a]
        for j in range(nv):
            total += s.A[a, j] * ws.vdot0[j]
        ws.W0[a] = total
        for i in range(nz):
            total = 0.0
            for j in range(nv):
                total += s.A[a, j] * ws.N[i, j]
            ws.B[a, i] = total
    ws.E[:, :] = 0.0
    share = 1.0 / nc
    soft = n - 6
    for i in range(nc):
        row = 6 * i
        for a in range(6):
            ws.w0[row + a] = share * ws.W0[a]
            for j in range(nz):
                ws.E[row + a, j] = share * ws.B[a, j]
            if i < nc - 1:
                ws.E[row + a, nz + 6 * i + a] = 1.0
            else:
                for other in range(nc - 1):
                    ws.E[row + a, nz + 6 * other + a] = -1.0
            if p.soft_root:
                ws.E[row + a, soft + a] = -share
        # about the CoM → about the sole: the force's moment over the arm is subtracted
        rx = s.sole_point[i, 0] - s.com[0]
        ry = s.sole_point[i, 1] - s.com[1]
        rz = s.sole_point[i, 2] - s.com[2]
        fx, fy, fz = ws.w0[row], ws.w0[row + 1], ws.w0[row + 2]
        ws.w0[row + 3] -= ry * fz - rz * fy
        ws.w0[row + 4] -= rz * fx - rx * fz
        ws.w0[row + 5] -= rx * fy - ry * fx
        for j in range(n):
            fx, fy, fz = ws.E[row, j], ws.E[row + 1, j], ws.E[row + 2, j]
            ws.E[row + 3, j] -= ry * fz - rz * fy
            ws.E[row + 4, j] -= rz * fx - rx * fz
            ws.E[row + 5, j] -= rx * fy - ry * fx


@compiled
def _carry_momentum(p, t, ws):
    """Posture velocities that carry L_ref: a_des += d_t N z, the least z with B z = [0; L_ref].

    The soles and the CoM stay where they are (A_P N z = 0), so this asks the trunk and arms to
    turn, which is what the posture's own damping holds back.
    """
    L = t.angular_momentum
    if L[0] == 0.0 and L[1] == 0.0 and L[2] == 0.0:
        return
    nz, nv = ws.N.shape
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
            ws.accel_des[j] += p.damping[j] * ws.N[i, j] * z


@compiled
def _torques(s, ws):
    """τ = τ₀ + T x on every joint's row of M v̇ + h − Jᵀw."""
    nz, nv = ws.N.shape
    nj, n = ws.T.shape
    for a in range(nj):
        d = 6 + a
        total = s.h[d]
        for j in range(nv):
            total += s.M[d, j] * ws.vdot0[j]
        for i in range(nz):
            row = 0.0
            for j in range(nv):
                row += s.M[d, j] * ws.N[i, j]
            ws.T[a, i] = row
        for i in range(nz, n):
            ws.T[a, i] = 0.0
        for r in range(s.J.shape[0]):
            lever = s.J[r, d]
            if lever != 0.0:
                total -= lever * ws.w0[r]
                for i in range(n):
                    ws.T[a, i] -= lever * ws.E[r, i]
        ws.tau0[a] = total


@compiled
def _add_square(H, g, row, offset, weight):
    """H, g += weight (row·x + offset)², upper triangle; `row` may be shorter than x."""
    for i in range(row.shape[0]):
        scaled = weight * row[i]
        g[i] += scaled * offset
        for j in range(i, row.shape[0]):
            H[i, j] += scaled * row[j]


@compiled
def _objective(robot, s, p, ws):
    """½ the weighted squares: posture, Ṗ, L̇, and small costs of wrenches, torques and x."""
    nz, nv = ws.N.shape
    n = ws.g.shape[0]
    H, g = ws.H, ws.g
    H[:, :] = 0.0
    g[:] = 0.0
    for i in range(nz):
        gradient = 0.0
        for j in range(nv):
            ws.weighted[j] = p.accel_weight[j] * ws.N[i, j]
            gradient += ws.weighted[j] * (ws.vdot0[j] - ws.accel_des[j])
        g[i] += gradient
        for k in range(i, nz):
            total = 0.0
            for j in range(nv):
                total += ws.weighted[j] * ws.N[k, j]
            H[i, k] += total
    for a in range(3):
        gravity = robot.mass * robot.gravity if a == 2 else 0.0
        offset = ws.W0[a] - gravity - ws.momentum_rate[a]
        _add_square(H, g, ws.B[a], offset, p.com_weight[a])
        offset = ws.W0[3 + a] - ws.momentum_rate[3 + a]
        _add_square(H, g, ws.B[3 + a], offset, p.angular_weight[a])
    for r in range(ws.w0.shape[0]):
        weight = p.force_weight if r % 6 < 3 else p.moment_weight
        _add_square(H, g, ws.E[r], ws.w0[r], weight)
    for a in range(ws.tau0.shape[0]):
        if p.torque_weight[a] > 0.0:
            _add_square(H, g, ws.T[a], ws.tau0[a], p.torque_weight[a])
    if p.soft_root:
        for i in range(6):
            H[n - 6 + i, n - 6 + i] += p.root_weight[i]
    for i in range(n):
        if i < nz:
            H[i, i] += p.accel_floor
        for j in range(i):
            H[i, j] = H[j, i]


@compiled
def _constraints(robot, s, p, ws):
    """Rows of C: wrench cones, torque limits, joint limits by braking distance."""
    nz = ws.N.shape[0]
    nc, rows = p.cone.shape[0], p.cone.shape[1]
    nj, n = ws.T.shape
    m = 0
    for i in range(nc):
        axes = s.sole_axes[i]
        for r in range(rows):
            offset = 0.0
            for j in range(n):
                ws.C[m, j] = 0.0
            for a in range(6):
                block, axis = 3 * (a // 3), a % 3
                coefficient = 0.0  # the cone is given in the sole's axes
                for b in range(3):
                    coefficient += p.cone[i, r, block + b] * axes[axis, b]
                offset += coefficient * ws.w0[6 * i + a]
                for j in range(n):
                    ws.C[m, j] += coefficient * ws.E[6 * i + a, j]
            ws.l[m], ws.u[m] = -np.inf, -offset
            m += 1
    for a in range(nj):
        for j in range(n):
            ws.C[m, j] = ws.T[a, j]
        ws.l[m] = -p.torque_limit[a] - ws.tau0[a]
        ws.u[m] = p.torque_limit[a] - ws.tau0[a]
        m += 1
    for a in range(nj):
        for j in range(n):
            ws.C[m, j] = ws.N[j, 6 + a] if j < nz else 0.0
        low, high = braking_bounds(
            s.qpos[7 + a], s.qvel[6 + a], robot.q_min[a], robot.q_max[a],
            p.brake_accel, p.brake_horizon, p.brake_floor,
        )  # fmt: skip
        ws.l[m], ws.u[m] = low - ws.vdot0[6 + a], high - ws.vdot0[6 + a]
        m += 1


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
def recover(s: StateArrays, p: QPParameters, ws: Workspace):
    """Accelerations, wrenches and torques from the solution x."""
    nz, nv = ws.N.shape
    nj, n = ws.T.shape
    for j in range(nv):
        ws.vdot[j] = ws.vdot0[j]
    for i in range(nz):
        for j in range(nv):
            ws.vdot[j] += ws.N[i, j] * ws.x[i]
    for r in range(ws.w0.shape[0]):
        total = ws.w0[r]
        for j in range(n):
            total += ws.E[r, j] * ws.x[j]
        ws.wrenches[r] = total
    for a in range(nj):
        total = ws.tau0[a]
        for j in range(n):
            total += ws.T[a, j] * ws.x[j]
        ws.tau[a] = min(max(total, -p.torque_limit[a]), p.torque_limit[a])
    for a in range(6):
        ws.root_wrench[a] = ws.x[n - 6 + a] if p.soft_root else 0.0
