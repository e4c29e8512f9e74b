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
    """Return (nq,) the posture on the sole of number `stance`, None where the legs do not allow it.

    The CoM moves sideways until it is over that sole's reference point, and keeps its place fore
    and aft; the other sole rises by the clearance of a step. Of such postures it is one that is
    near the standing one: Gauss–Newton on the tasks, and in their null space back to the standing
    posture. Joints stay in their ranges.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    goal, _ = _tasks(robot, data, stance)
    goal[3:6] = 0.0  # no turn
    goal[7] = goal[1]  # the CoM beside the sole
    goal[8] += SwingTask().clearance * robot.height_com
    scale = np.ones(model.nv)
    scale[:3] = robot.height_com
    for _ in range(ROUNDS):
        values, jacobian = _tasks(robot, data, stance)
        residual = values - goal
        if np.abs(residual).max() < CLOSE:
            return data.qpos.copy()
        change = _change(robot, data, residual, jacobian * scale, scale)
        change *= min(1.0, STEP / max(np.abs(change).max(), STEP))
        mujoco.mj_integratePos(model, data.qpos, scale * change, 1.0)
        data.qpos[7:] = np.clip(data.qpos[7:], *robot.joint_range.T)
    return None


def _tasks(robot: Robot, data: mujoco.MjData, stance: int) -> tuple[np.ndarray, np.ndarray]:
    """(9,) the stance sole's place and turn, the CoM, the other's height; the (9, nv) Jacobian.

    The turn is back to the world's axes, in which the sole stands: R = exp(r) ≈ 1 + [r]ₓ.
    """
    model, (sole, lifted) = robot.model, (robot.soles[stance], robot.soles[1 - stance])
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    point, other = _point(robot, data, stance), _point(robot, data, 1 - stance)
    axes = data.xmat[sole.body_id].reshape(3, 3) @ sole.rotation
    turn = [axes[2, 1] - axes[1, 2], axes[0, 2] - axes[2, 0], axes[1, 0] - axes[0, 1]]
    centre = data.subtree_com[robot.root_body_id]
    values = np.concatenate([point, 0.5 * np.array(turn), centre[:2], other[2:]])
    at, turned, com, lift = (np.zeros((3, model.nv)) for _ in range(4))
    mujoco.mj_jac(model, data, at, turned, point, sole.body_id)
    mujoco.mj_jacSubtreeCom(model, data, com, robot.root_body_id)
    mujoco.mj_jac(model, data, lift, None, other, lifted.body_id)
    return values, np.vstack([at, turned, com[:2], lift[2]])


def _point(robot: Robot, data: mujoco.MjData, sole: int) -> np.ndarray:
    """Return (3,) a sole's reference point [m]."""
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
