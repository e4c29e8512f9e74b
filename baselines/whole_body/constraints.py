"""The compiled constraints: cones of contacts, torques, joints that can still stop in time."""

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .contacts.contact import ContactArrays
from .parameters import QPParameters
from .workspace import Workspace


@compiled
def build_constraints(
    robot: RobotArrays, s: StateArrays, p: QPParameters, c: ContactArrays, ws: Workspace
):
    """Fill C, l and u: the cones of soles and of other contacts, torque limits, joint limits."""
    _sole_cones(s, p, ws)
    _point_cones(c, ws)
    _torque_limits(p, ws)
    _joint_limits(robot, s, p, ws)


@compiled
def _sole_cones(s: StateArrays, p: QPParameters, ws: Workspace):
    """Fill cone · w ≤ 0 in each sole's own axes, for the estimated friction.

    With less of it forces along the sole and moments about its normal count for more.
    """
    nc, rows = p.cone.shape[0], p.cone.shape[1]
    narrower = 1.0 / s.friction
    for i in range(nc):
        axes, first = s.sole_axes[i], i * rows
        for a in range(6):
            r, c = 6 * i + a // 3 * 3, a % 3  # of the force or the moment; the sole's axis
            x, y, z = axes[0, c], axes[1, c], axes[2, c]
            if a < 2 or a == 5:
                x, y, z = narrower * x, narrower * y, narrower * z
            ws.local0[a] = x * ws.w0[r] + y * ws.w0[r + 1] + z * ws.w0[r + 2]
            for j in range(ws.local.shape[1]):
                ws.local[a, j] = x * ws.E[r, j] + y * ws.E[r + 1, j] + z * ws.E[r + 2, j]
        np.dot(p.cone[i], ws.local, ws.C[first : first + rows])
        for r in range(rows):
            total = 0.0
            for a in range(6):
                total += p.cone[i, r, a] * ws.local0[a]
            ws.l[first + r], ws.u[first + r] = -np.inf, -total


@compiled
def _point_cones(c: ContactArrays, ws: Workspace):
    """Fill cone · f ≤ bound of each point, whose force is among the unknowns."""
    for i in range(c.positions.shape[0]):
        for r in range(c.rows[i], c.rows[i + 1]):
            row = ws.first_point + r
            ws.C[row, :] = 0.0
            for a in range(3):
                ws.C[row, ws.first_force + 3 * i + a] = c.cone[r, a]
            ws.l[row], ws.u[row] = -np.inf, c.bound[r]


@compiled
def _torque_limits(p: QPParameters, ws: Workspace):
    """Fill |τ₀ + T x| ≤ τ_max."""
    first = ws.first_torque
    for a in range(ws.tau0.shape[0]):
        copy_into(ws.T[a], ws.C[first + a])
        ws.l[first + a] = -p.torque_limit[a] - ws.tau0[a]
        ws.u[first + a] = p.torque_limit[a] - ws.tau0[a]


@compiled
def _joint_limits(robot: RobotArrays, s: StateArrays, p: QPParameters, ws: Workspace):
    """Keep joint accelerations v̇₀ + V x within `braking_bounds`, if joints brake at all."""
    first = ws.first_joint
    for a in range(ws.tau0.shape[0]):
        copy_into(ws.V[6 + a], ws.C[first + a])
        if not p.brakes:
            ws.l[first + a], ws.u[first + a] = -np.inf, np.inf
            continue
        low, high = braking_bounds(
            s.qpos[7 + a], s.qvel[6 + a], robot.q_min[a], robot.q_max[a],
            p.brake_accel, p.brake_horizon, p.brake_floor,
        )  # fmt: skip
        ws.l[first + a], ws.u[first + a] = low - ws.vdot0[6 + a], high - ws.vdot0[6 + a]


@compiled
def braking_bounds(
    q: float, v: float, q_min: float, q_max: float, accel: float, horizon: float, floor: float
) -> tuple[float, float]:
    """Return bounds on q̈ that let a joint stop before its limit.

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
def stopping_speed(distance: float, accel: float, horizon: float) -> float:
    """Return the speed v that stops in a distance after a time r: r v + v²/(2 accel) = distance.

    r = 4·horizon makes the way to the limit critically damped: no overshoot. Beyond the limit the
    speed leads back to it.
    """
    reaction = 4.0 * horizon
    if distance < 0.0:
        return distance / reaction
    lag = reaction * accel
    return np.sqrt(lag * lag + 2.0 * accel * distance) - lag
