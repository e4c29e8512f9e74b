"""The built-in tasks of the readable momentum QP: rows A, b and weights of ½ Σ weight (A x − b)².

x = (v̇, w) or (v̇, w, u_root); see `formulation.py`. Gains and weights come from `QPParameters`.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.controller import Targets
from poise.envs.physics.state import RobotState

from .constraint_rows import torque_matrix
from .contacts.contact import ContactRows
from .objective import posture_fraction
from .parameters import QPParameters
from .tasks.task import Rows


def posture_rows(state: RobotState, targets: Targets, p: QPParameters) -> Rows:
    """h_t = β ‖v̇ − (a_ref + k_t (q_ref ⊖ q) + d_t (v_ref + v* − v))‖².

    The root's q_ref ⊖ q is the rotation vector of RᵀR_ref, in body axes like its velocity; where
    the root is, is the CoM's business: its three linear rows have no weight. v* carries the
    angular momentum that is asked for.
    """
    turn = Rotation.from_matrix(state.root_axes.T @ targets.root_axes).as_rotvec()
    error = np.concatenate([np.zeros(3), turn, targets.q_ref - state.q])
    v_ref = np.concatenate([np.zeros(3), targets.root_vel, targets.v_ref])
    a_ref = np.concatenate([np.zeros(3), targets.root_acc, targets.a_ref])
    v_ref = v_ref + carrying_velocity(state, targets.angular_momentum)
    desired = a_ref + p.stiffness * error + p.damping * (v_ref - state.qvel)
    fraction = posture_fraction(p, state.com, targets.com)
    return Rows(np.eye(len(desired)), desired, fraction * p.accel_weight)


def carrying_velocity(state: RobotState, angular_momentum: np.ndarray) -> np.ndarray:
    """(nv,) least v* that has A_L v* = L_ref and moves neither the soles nor the CoM."""
    rows = np.vstack([state.J, state.A])
    desired = np.concatenate([np.zeros(len(rows) - 3), angular_momentum])
    return np.linalg.lstsq(rows, desired, rcond=None)[0]


def desired_linear_rate(state: RobotState, targets: Targets, p: QPParameters) -> np.ndarray:
    """Ṗ_des = m (c̈_ref + s_c (c_ref − c) + d_c (ċ_ref − ċ)) [N]."""
    return state.mass * (
        targets.com_acc
        + p.com_stiffness * (targets.com - state.com)
        + p.com_damping * (targets.com_vel - state.com_vel)
    )


def desired_cop(
    state: RobotState, targets: Targets, p: QPParameters, cop_vel: np.ndarray
) -> np.ndarray:
    """(3,) p_des after the horizon T of p̈_des = −s_p (p − p_ref) − d_p ṗ, from p and ṗ."""
    T = p.cop_horizon
    accel = -p.cop_stiffness * (state.cop - targets.cop) - p.cop_damping * cop_vel
    return np.append(state.cop + T * cop_vel + 0.5 * T**2 * accel, state.origin[2])


def desired_angular_rate(
    state: RobotState, targets: Targets, p: QPParameters, cop_vel: np.ndarray
) -> np.ndarray:
    """L̇_des = (p_des − c) × (Ṗ_des − m g) − k_L L [N·m]."""
    gravity = np.array([0.0, 0.0, -state.robot.gravity])
    ground_force = desired_linear_rate(state, targets, p) - state.mass * gravity
    arm = desired_cop(state, targets, p, cop_vel) - state.com
    return np.cross(arm, ground_force) - p.angular_damping * state.angular_momentum


def linear_momentum_rows(state: RobotState, targets: Targets, p: QPParameters) -> Rows:
    """h_c = ‖A_P v̇ + Ȧ_P v − Ṗ_des‖²: where the centre of mass goes."""
    b = desired_linear_rate(state, targets, p) - state.Adot_v[:3]
    return Rows(state.A[:3], b, p.com_weight)


def angular_momentum_rows(
    state: RobotState, targets: Targets, p: QPParameters, cop_vel: np.ndarray
) -> Rows:
    """h_p = ‖A_L v̇ + Ȧ_L v − L̇_des‖²: where the centre of pressure goes."""
    b = desired_angular_rate(state, targets, p, cop_vel) - state.Adot_v[3:]
    return Rows(state.A[3:], b, p.angular_weight)


def wrench_rows(state: RobotState, p: QPParameters, points: Sequence[ContactRows] = ()) -> Rows:
    """Small wrenches of soles, ‖w‖², which also says how two share one load; forces of points as
    these want them."""
    nv, soles = len(state.qvel), len(state.J)
    weights = np.tile(np.repeat([p.force_weight, p.moment_weight], 3), soles // 6)
    weights = np.concatenate([weights, *(point.weights for point in points)])
    desired = np.concatenate([np.zeros(soles), *(point.force for point in points)])
    k = len(desired)
    return Rows(np.eye(k, nv + k, nv), desired, weights)


def accel_rows(state: RobotState, p: QPParameters) -> Rows:
    """Small accelerations: ‖v̇‖², a trace that keeps the compiled problem well posed."""
    nv = len(state.qvel)
    return Rows(np.eye(nv), np.zeros(nv), np.full(nv, p.accel_floor))


def torque_rows(state: RobotState, p: QPParameters, points: Sequence[ContactRows] = ()) -> Rows:
    """Small torques: ‖τ‖²."""
    return Rows(torque_matrix(state, points), -state.h[6:], p.torque_weight)


def root_rows(state: RobotState, p: QPParameters, points: Sequence[ContactRows] = ()) -> Rows:
    """ω_root ‖u_root‖²: what a soft root must not lean on."""
    start = len(state.qvel) + len(state.J) + 3 * len(points)
    return Rows(np.eye(6, start + 6, start), np.zeros(6), p.root_weight)
