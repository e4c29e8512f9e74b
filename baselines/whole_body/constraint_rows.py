"""Dynamics, contacts and limits of the readable momentum QP: each gives rows l ≤ C x ≤ u.

x = (v̇, w) or (v̇, w, u_root); see `formulation.py`. w are the wrenches of the soles, then the forces
of `points`, contacts of other bodies.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from poise.envs.physics.state import RobotState

from .contacts.contact import ContactRows
from .limits.limit import Bounds
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
