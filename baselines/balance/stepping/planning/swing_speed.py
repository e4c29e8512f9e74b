"""The fastest swing that the joints of a leg can do, and the limits of steps that follow from it.

A joint is as fast as its motor overcomes damping and friction with what the leg's weight and its
springs leave of the torque limit:

    |q̇| ≤ (τ_max − |τ_rest| − τ_friction)/damping

A foot that goes from rest to rest on a polynomial of degree five is midway 15/8 times as fast as in
the mean.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.optimize import linprog

from poise.envs.physics.arrays import dof_chain
from poise.envs.physics.legs import standing_data
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose

from .config import StepLimits, SwingTask

PEAK = 15.0 / 8.0  # of a speed over its mean, from rest to rest
ROUNDS, STEP, CLOSE = 60, 0.05, 1e-6  # of the lift; most that a round turns a joint [rad]; [m]
FINE = 1e-3  # [m] to which heights are found
NEAR = 1e-3  # [m] where only whether a place is reached counts
STILL = 1e-6  # [m/s] of a foot that its joints do not move at all
UNBOUNDED = 3  # status of a linear program


class SwingSpeed(NamedTuple):
    """Mean speeds that a foot can have in a swing [m/s], infinite where no joint bounds them."""

    ahead: float
    sideways: float
    lift: float  #: up to the clearance of a step, or down from it


@lru_cache(maxsize=16)
def swing_speed(robot: Robot, clearance: float, torque_share: float = 1.0) -> SwingSpeed:
    """The speeds of the slower foot, from the standing posture and with the root at rest.

    Args:
        clearance: by which the foot is lifted [m].
        torque_share: fraction of the motors' limits that counts.
    """
    feet = [_foot_speed(robot, sole, clearance, torque_share) for sole in range(len(robot.soles))]
    return SwingSpeed(*np.min(feet, axis=0).tolist())


def possible_limits(
    robot: Robot, limits: StepLimits, swing: SwingTask, torque_share: float = 1.0
) -> StepLimits | None:
    """The `limits` of steps within what the legs can do; None: they can do no step.

    The foot rises in `swing.lift` of the time and comes down in the rest. Where that takes longer
    than `time_max` it would not land in time. Limits that do not bind are those given, to the bit.
    `torque_share` is that of `swing_speed`.
    """
    h, omega = robot.height_com, robot.omega
    speed = swing_speed(robot, swing.clearance * h, torque_share)
    if min(speed) <= STILL:
        return None
    time = swing_time(robot, swing, swing.clearance * h, torque_share) * omega
    if time > limits.time_max:
        return None
    return replace(
        limits,
        speed=min(limits.speed, speed.ahead / (h * omega)),
        side_speed=min(limits.side_speed, speed.sideways / (h * omega)),
        time_min=max(limits.time_min, time),
    )


def swing_time(
    robot: Robot, swing: SwingTask, clearance: float, torque_share: float = 1.0
) -> float:
    """The least time of a swing that lifts the foot by `clearance` [m] and puts it down [s]."""
    lift = swing_speed(robot, clearance, torque_share).lift
    return clearance / (min(swing.lift, 1.0 - swing.lift) * lift) if lift > 0.0 else np.inf


@lru_cache(maxsize=16)
def highest_lift(robot: Robot) -> float:
    """The height to which either foot can be lifted straight up in the standing posture, within
    its joints' ranges, to 1 mm [m]."""

    def possible(height: float) -> bool:
        ways = (
            _lift(robot, standing_data(robot), sole, height, level=False)
            for sole in range(len(robot.soles))
        )
        return all(way is not None for way in ways)

    return highest(possible, robot.height_com)


def highest(possible: Callable[[float], bool], high: float) -> float:
    """The highest of the heights below `high` that are possible, to 1 mm and not above it [m]."""
    low = 0.0
    while high - low > FINE:
        middle = 0.5 * (low + high)
        if possible(middle):
            low = middle
        else:
            high = middle
    return low


def _leg_dofs(robot: Robot, sole: int) -> np.ndarray:
    """(n,) degrees of freedom of the joints between the root and a sole."""
    chain = dof_chain(robot.model, robot.soles[sole].body_id)
    return np.array([dof for dof in chain if dof >= 6])


def _foot_speed(robot: Robot, sole: int, clearance: float, share: float) -> SwingSpeed:
    """The speeds of one foot, where the leg has lifted it as high as it can of `clearance`."""
    data, dofs = standing_data(robot), _leg_dofs(robot, sole)
    way = _lift(robot, data, sole, clearance, level=True)
    fastest = _joint_speeds(robot, data, dofs, share) / PEAK
    place, turn = _jacobian(robot, data, sole, dofs)
    lift = np.inf
    if way is not None:
        moving = np.abs(way) > 0.0
        lift = clearance * np.min(fastest[moving] / np.abs(way[moving]))
    ahead, sideways = (_fastest(place, turn, axis, fastest) for axis in range(2))
    return SwingSpeed(ahead, sideways, lift)


def _joint_speeds(robot: Robot, data: mujoco.MjData, dofs: np.ndarray, share: float) -> np.ndarray:
    """(n,) the speeds of the leg's joints at their torque limits in the posture of `data`."""
    model = robot.model
    mujoco.mj_forward(model, data)
    limit = np.zeros(model.nv)
    limit[robot.motor_dofs] = share * robot.torque_limit
    resting = np.abs(data.qfrc_bias - data.qfrc_passive) + model.dof_frictionloss
    left = np.maximum(limit - resting, 0.0)[dofs]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(left > 0.0, left / model.dof_damping[dofs], 0.0)


def _lift(
    robot: Robot, data: mujoco.MjData, sole: int, clearance: float, level: bool
) -> np.ndarray | None:
    """(n,) the way of the leg's joints that lifts the sole by `clearance`; None if none is found.

    It stays `level`, whatever the joints' ranges, or they keep to these, whatever it turns. The
    posture of `data` goes that way.
    """
    model, dofs = robot.model, _leg_dofs(robot, sole)
    low, high = robot.joint_range[dofs - 6].T
    start = data.qpos[dofs + 1].copy()
    goal = sole_pose(data, robot.soles[sole])[0] + [0.0, 0.0, clearance]
    for _ in range(ROUNDS):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        off = goal - sole_pose(data, robot.soles[sole])[0]
        if np.abs(off).max() < (CLOSE if level else NEAR):
            return data.qpos[dofs + 1] - start
        place, (rows, turn) = data.qpos[dofs + 1], _jacobian(robot, data, sole, dofs)
        if level:  # a leg that cannot keep the sole level turns it
            rows = np.concatenate([rows, turn * (0.1 * robot.height_com)])
            off = np.concatenate([off, np.zeros(3)])
        else:
            rows = rows * ((low < place) & (place < high))  # what is at its end stays there
        change = np.linalg.lstsq(rows, off, rcond=1e-4)[0]
        place = place + change * min(1.0, STEP / max(np.abs(change).max(), STEP))
        data.qpos[dofs + 1] = place if level else np.clip(place, low, high)
    return None


def _fastest(place: np.ndarray, turn: np.ndarray, axis: int, fastest: np.ndarray) -> float:
    """The largest speed along an axis that joints no faster than `fastest` (n,) give the sole.

    A linear program. The sole stays level, or turns where the leg has no joint for that; it may
    turn about the vertical. `place` and `turn` are those of `_jacobian`.
    """
    n, (roll, pitch, _) = place.shape[1], turn
    bounds = [(-v, v) if np.isfinite(v) else (None, None) for v in fastest.tolist()]
    speed = 0.0
    for level in ([roll, pitch], [pitch], [roll], []):
        rows = np.array([*place, *level])
        wanted = np.zeros(len(rows))
        wanted[axis] = -1.0
        found = linprog(
            c=[*np.zeros(n), -1.0],
            A_eq=np.column_stack([rows, wanted]),
            b_eq=np.zeros(len(rows)),
            bounds=[*bounds, (0.0, None)],
        )
        speed = np.inf if found.status == UNBOUNDED else float(-found.fun)
        if speed > STILL:
            break
    return speed


def _jacobian(
    robot: Robot, data: mujoco.MjData, sole: int, dofs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(3, n) of the place of a sole's reference point, and of its turn; the robot faces along x."""
    place, turn = np.zeros((2, 3, robot.model.nv))
    foot = robot.soles[sole]
    point, _ = sole_pose(data, foot)
    mujoco.mj_jac(robot.model, data, place, turn, point, foot.body_id)
    return place[:, dofs], turn[:, dofs]
