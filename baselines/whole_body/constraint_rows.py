"""Dynamics, contacts and limits of the readable momentum QP: each gives rows l ≤ C x ≤ u.

x = (v̇, w) or (v̇, w, u_root); see `formulation.py`. w are the wrenches of the soles, then the forces
of `points`, contacts of other bodies.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from poise.baselines.controller import Targets
from poise.envs.physics.state import RobotState

from .contacts.contact import ContactRows
from .limits.limit import Bounds
from .objective import posture_fraction
from .parameters import QPParameters
from .tasks.task import Rows


def contact_jacobian(state: RobotState, points: Sequence[ContactRows] = ()) -> np.ndarray:
    """(k, nv) J of everything in contact: six rows a sole, three a point."""
    return np.vstack([state.J, *(point.J for point in points)])


def root_dynamics(state: RobotState, p: QPParameters, points: Sequence[ContactRows] = ()) -> Bounds:
    """The root's six rows of M v̇ + h = Sᵀτ + Jᵀw + u_root, where no motor helps."""
    C = np.hstack([state.M[:6], -contact_jacobian(state, points).T[:6]])
    if p.soft_root:
        C = np.hstack([C, -_root_force_matrix(state)])
    return Bounds(C, -state.h[:6], -state.h[:6])


def sole_motion(state: RobotState, p: QPParameters) -> Bounds:
    """J v̇ + J̇ v = −k_v J v: soles do not accelerate, and what speed they have dies out."""
    accel = -p.sole_damping * state.J_v - state.Jdot_v
    return Bounds(state.J, accel, accel)


def contact_motion(
    state: RobotState, p: QPParameters, points: Sequence[ContactRows] = ()
) -> tuple[Bounds, Rows]:
    """What the contacts are to do: equalities, and the rows that are a task instead.

    These are none, or the weakest row of J on legs of fewer than six joints (`null_space.py`).
    """
    J = contact_jacobian(state, points)
    accel = np.concatenate([sole_motion(state, p).l, *(point.accel for point in points)])
    weak = np.zeros(len(J), dtype=bool)
    if len(state.J) > 6 and p.weakest_weight.any():
        weak[weakest_row(J)] = True
    turns = (np.arange(len(J)) % 6 >= 3) & (np.arange(len(J)) < len(state.J))
    weights = np.where(turns, p.weakest_weight[1], p.weakest_weight[0])
    return Bounds(J[~weak], accel[~weak], accel[~weak]), Rows(J[weak], accel[weak], weights[weak])


def weakest_row(J: np.ndarray) -> int:
    """The row that is left once all others have been taken, each the longest of those that remain
    at right angles to those taken before; of equal ones the first."""
    left, rest = list(range(len(J))), J.copy()
    while len(left) > 1:
        length2 = np.sum(rest[left] ** 2, axis=1)
        taken = left.pop(int(np.argmax(length2 > length2.max() * (1.0 - 1e-9))))
        along = rest[taken] / np.linalg.norm(rest[taken])
        rest -= np.outer(rest @ along, along)
    return left[0]


def point_cones(state: RobotState, points: Sequence[ContactRows]) -> Bounds:
    """cone · f ≤ bound of each point in contact."""
    columns = len(state.qvel) + len(state.J)
    C = np.pad(block_diag(*(point.cone for point in points)), ((0, 0), (columns, 0)))
    return Bounds(C, np.full(len(C), -np.inf), np.concatenate([point.bound for point in points]))


def sole_cones(state: RobotState, p: QPParameters) -> Bounds:
    """cone · w ≤ 0 in each sole's own axes (see `wrench_cone`), for the estimated friction.

    A cone of s times the friction has the same wrenches with f_x, f_y and n_z s times as large.
    """
    narrower = np.ones(6)
    narrower[[0, 1, 5]] = 1.0 / state.friction
    cones = [
        (cone * narrower) @ block_diag(axes.T, axes.T)
        for cone, axes in zip(p.cone, state.sole_axes, strict=True)
    ]
    C = np.pad(block_diag(*cones), ((0, 0), (len(state.qvel), 0)))
    return Bounds(C, np.full(len(C), -np.inf), np.zeros(len(C)))


def torque_limits(state: RobotState, p: QPParameters, points: Sequence[ContactRows] = ()) -> Bounds:
    """|τ| ≤ τ_max; a joint without a motor has τ_max = 0."""
    h = state.h[6:]
    return Bounds(torque_matrix(state, points), -p.torque_limit - h, p.torque_limit - h)


def joint_limits(state: RobotState, p: QPParameters) -> Bounds:
    """Accelerations that let every joint stop before its limit.

    From the distance d to a limit, a joint that is no faster than v stops if it brakes with a
    after a reaction time r: r v + v²/(2 a) = d. The bound brings its speed there within a horizon
    T, and demands no more than a floor; r = 4 T makes the approach critically damped. Beyond the
    limit, v = d/r leads back.
    """
    q, v, robot = state.q, state.qvel[6:], state.robot
    up, down = (_stopping_speed(d, p) for d in (robot.q_max - q, q - robot.q_min))
    low = np.minimum((-down - v) / p.brake_horizon, p.brake_floor)
    high = np.maximum((up - v) / p.brake_horizon, -p.brake_floor)
    C = np.eye(len(q), len(q) + 6, 6)
    return Bounds(C, low, np.maximum(low, high))


def _stopping_speed(distance: np.ndarray, p: QPParameters) -> np.ndarray:
    reaction = 4.0 * p.brake_horizon
    ahead, lag = np.maximum(distance, 0.0), reaction * p.brake_accel
    speed = np.sqrt(lag**2 + 2.0 * p.brake_accel * ahead) - lag
    return np.where(distance < 0.0, distance / reaction, speed)


def torque_matrix(state: RobotState, points: Sequence[ContactRows] = ()) -> np.ndarray:
    """(nv−6, nv+k) T with τ = T (v̇, w) + h."""
    return np.hstack([state.M, -contact_jacobian(state, points).T])[6:]


def _root_force_matrix(state: RobotState) -> np.ndarray:
    """(6, 6) from a wrench about the CoM to the root's generalised forces.

    The force acts as it is; the moment about the root's origin is n + (c − r) × f, in body axes.
    """
    r = state.com - state.qpos[:3]
    arm = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    R = state.root_axes
    return np.block([[np.eye(3), np.zeros((3, 3))], [R.T @ arm, R.T]])


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
    """L̇_des = (p_des − c) × (Ṗ_des − m g − f) − k_L L [N·m], f the force of a load."""
    weight = np.array([0.0, 0.0, state.load[0] - state.mass * state.robot.gravity])
    ground_force = desired_linear_rate(state, targets, p) - weight
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
