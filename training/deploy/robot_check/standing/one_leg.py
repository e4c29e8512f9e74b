"""A posture on one leg: the CoM over one foot, the other lifted."""

import mujoco
import numpy as np

from poise.baselines.balance.stepping.planning.config import SwingTask
from poise.envs.robots.robot import Robot

ROUNDS = 200
STEP = 0.05  # most that a round changes a joint [rad], and the root over the CoM height
CLOSE = 1e-6  # [m] and [rad]
TINY = 1e-12  # of a change that is none


def one_leg_qpos(robot: Robot, stance: int) -> np.ndarray | None:
    """(nq,) the posture on the sole of number `stance`, None where the legs do not allow it.

    The CoM moves sideways until it is over that sole's reference point, and keeps its place fore
    and aft; the other sole rises by the clearance of a step. Of such postures it is one that is
    near the standing one: Gauss–Newton on the tasks, and in their null space back to the standing
    posture. Joints stay in their ranges.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    goal = _goal(robot, data, stance)
    scale = np.ones(model.nv)
    scale[:3] = robot.height_com
    for _ in range(ROUNDS):
        residual, jacobian = _tasks(robot, data, stance, goal)
        if np.abs(residual).max() < CLOSE:
            return data.qpos.copy()
        change = _change(robot, data, residual, jacobian * scale, scale)
        change *= min(1.0, STEP / max(np.abs(change).max(), STEP))
        mujoco.mj_integratePos(model, data.qpos, scale * change, 1.0)
        data.qpos[7:] = np.clip(data.qpos[7:], *robot.joint_range.T)
    return None


def _goal(robot: Robot, data: mujoco.MjData, stance: int) -> np.ndarray:
    """(9,) what `_tasks` are to be: the sole's place, no turn, the CoM, the other sole's height."""
    place = _values(robot, data, stance)
    lift = SwingTask().clearance * robot.height_com
    return np.array([*place[:6], place[6], place[1], place[8] + lift])


def _values(robot: Robot, data: mujoco.MjData, stance: int) -> np.ndarray:
    """(9,) the stance sole's place and three zeros for its turn, the CoM, the other's height."""
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    place, other = _point(robot, data, stance), _point(robot, data, 1 - stance)
    com = data.subtree_com[robot.root_body_id]
    return np.array([*place, 0.0, 0.0, 0.0, com[0], com[1], other[2]])


def _tasks(
    robot: Robot, data: mujoco.MjData, stance: int, goal: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(9,) the tasks' distance from the goal, and its (9, nv) Jacobian."""
    model, sole = robot.model, robot.soles[stance]
    residual = _values(robot, data, stance) - goal
    axes = data.xmat[sole.body_id].reshape(3, 3) @ sole.rotation
    # the turn back to the world's axes, in which the sole stands: R = exp(r) ≈ 1 + [r]ₓ
    residual[3:6] = 0.5 * np.array(
        [axes[2, 1] - axes[1, 2], axes[0, 2] - axes[2, 0], axes[1, 0] - axes[0, 1]]
    )
    place, turn, com, lift = (np.zeros((3, model.nv)) for _ in range(4))
    mujoco.mj_jac(model, data, place, turn, _point(robot, data, stance), sole.body_id)
    mujoco.mj_jacSubtreeCom(model, data, com, robot.root_body_id)
    other = _point(robot, data, 1 - stance)
    mujoco.mj_jac(model, data, lift, None, other, robot.soles[1 - stance].body_id)
    return residual, np.vstack([place, turn, com[:2], lift[2]])


def _point(robot: Robot, data: mujoco.MjData, sole: int) -> np.ndarray:
    """(3,) a sole's reference point [m]."""
    foot = robot.soles[sole]
    return data.xpos[foot.body_id] + data.xmat[foot.body_id].reshape(3, 3) @ foot.position


def _change(
    robot: Robot, data: mujoco.MjData, residual: np.ndarray, jacobian: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """(nv,) towards the tasks, and in their null space to the standing posture, over `scale`.

    Joints at a limit that would leave their range do not move.
    """
    low, high = robot.joint_range.T
    back = np.zeros(robot.model.nv)
    mujoco.mj_differentiatePos(robot.model, back, 1.0, data.qpos, robot.standing_qpos)
    free = np.full(robot.model.nv, True)
    while True:
        moved = np.where(free, jacobian, 0.0)
        wish = np.where(free, back / scale, 0.0)
        change = wish - np.linalg.pinv(moved, rcond=1e-6) @ (residual + moved @ wish)
        out = (data.qpos[7:] <= low) & (change[6:] < -TINY)
        out |= (data.qpos[7:] >= high) & (change[6:] > TINY)
        if not np.any(out & free[6:]):
            return change
        free[6:] &= ~out
