"""The compiled objective: posture, momentum, and small costs of wrenches, torques and x."""

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import cross, turn_error
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays, borne_weight

from .parameters import QPParameters
from .workspace import Workspace


@compiled
def desired_accelerations(s: StateArrays, p: QPParameters, t: TargetArrays, ws: Workspace):
    """Fill a_ref + k_t (q_ref ⊖ q) + d_t (v_ref − v), of the root's axes by a rotation vector."""
    error = ws.y
    scale = turn_error(s.root_axes, t.root_axes, error)
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
def desired_momentum_rate(
    robot: RobotArrays,
    s: StateArrays,
    p: QPParameters,
    t: TargetArrays,
    period: float,
    ws: Workspace,
):
    """Fill Ṗ_des from the CoM's PD law, and L̇_des = (p_des − c) × (Ṗ_des − m g) − k_L L."""
    for a in range(2):
        if np.isnan(ws.cop_prev[a]):
            ws.cop_prev[a] = s.cop[a]
        ws.cop_vel[a] = (s.cop[a] - ws.cop_prev[a]) / period
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
    force[2] += borne_weight(robot, s)
    arm[2] += s.origin[2]
    T = p.cop_horizon
    for a in range(2):
        accel = -p.cop_stiffness * (s.cop[a] - t.cop[a]) - p.cop_damping * ws.cop_vel[a]
        arm[a] += s.cop[a] + T * ws.cop_vel[a] + 0.5 * T * T * accel
    cross(arm, force, ws.momentum_rate[3:6])
    for a in range(3):
        ws.momentum_rate[3 + a] -= p.angular_damping * s.momentum[3 + a]


@compiled
def carry_momentum(p: QPParameters, t: TargetArrays, ws: Workspace):
    """Let the posture carry L_ref: a_des += d_t V z, with the least z that has B z = [0; L_ref].

    The soles and the CoM stay where they are (A_P V z = 0), so this asks the trunk and arms to
    turn, which is what the posture's own damping holds back.
    """
    L = t.angular_momentum
    if L[0] == 0.0 and L[1] == 0.0 and L[2] == 0.0:
        return
    nv = ws.V.shape[0]
    nz = ws.first_internal
    G, y = ws.BBt, ws.y
    trace = 0.0
    for a in range(6):
        for b in range(6):
            total = 0.0
            for i in range(ws.space.spare, nz):
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
    for i in range(ws.space.spare, nz):
        z = 0.0
        for a in range(6):
            z += ws.B[a, i] * y[a]
        for j in range(3, nv):
            ws.accel_des[j] += p.damping[j] * ws.V[j, i] * z


@compiled
def posture_fraction(p: QPParameters, com: np.ndarray, com_ref: np.ndarray) -> float:
    """The fraction β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally, that the weights of the
    posture keep."""
    x, y = com[0] - com_ref[0], com[1] - com_ref[1]
    away = (x * x + y * y) / (p.far_distance * p.far_distance)
    return p.far_share + (1.0 - p.far_share) * np.exp(-away)


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


@compiled
def build_objective(
    robot: RobotArrays, s: StateArrays, p: QPParameters, t: TargetArrays, ws: Workspace
):
    """Fill H and g: ½ the weighted squares of posture, Ṗ, L̇, wrenches, torques and x.

    What is desired of v̇ lies in the workspace already, and so do the weights and desired forces of
    contacts other than soles.
    """
    nv, n = ws.V.shape
    nz, weights = ws.first_internal, ws.weights
    fraction = posture_fraction(p, s.com, t.com)
    for j in range(nv):
        ws.accel_weights[j] = fraction * p.accel_weight[j]
    for a in range(3):
        ws.momentum_weights[a], ws.momentum_weights[3 + a] = p.com_weight[a], p.angular_weight[a]
        ws.wrench_des[a], ws.wrench_des[3 + a] = ws.momentum_rate[a], ws.momentum_rate[3 + a]
    ws.wrench_des[2] += borne_weight(robot, s)
    for r in range(s.J.shape[0]):
        ws.force_weights[r] = p.force_weight if r % 6 < 3 else p.moment_weight
    for a in range(ws.tau0.shape[0]):
        ws.torque_weights[a] = p.torque_weight[a]
    ws.g[:] = 0.0
    for r in range(weights.shape[0]):
        residual = weights[r] * (ws.offsets[r] - ws.desired[r])
        for j in range(n):
            ws.weighted[r, j] = weights[r] * ws.rows[r, j]
            ws.g[j] += residual * ws.rows[r, j]
    np.dot(ws.rows.T, ws.weighted, ws.H)
    weigh_weakest_row(s, p, ws)
    if p.soft_root:
        for i in range(6):
            ws.H[ws.first_root + i, ws.first_root + i] += p.root_weight[i]
    for i in range(n):
        if i < nz:
            ws.H[i, i] += p.accel_floor
        for j in range(i):
            ws.H[i, j] = ws.H[j, i]
