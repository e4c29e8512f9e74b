"""Prediction of the state at which the torques of this tick act, by simulating the known robot."""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import axes_of, copy_into, quaternion_of
from poise.envs.compiled.mujoco_calls import mj_step1, mj_step2
from poise.envs.physics.arrays import RobotArrays, SimViews

from .motors import RING, Motors


@dataclass(frozen=True, eq=False)
class Rollout(Block):
    """A simulation of the known robot, of which nothing is remembered."""

    robot: RobotArrays
    views: SimViews
    motors: Motors  # their past commands


@compiled
def roll_out(
    o: Rollout, first: int, count: int, earlier: int, wrench: np.ndarray,
    position: np.ndarray, R: np.ndarray, q: np.ndarray, v: np.ndarray,
):  # fmt: skip
    """Lead a state on by `count` physics steps of the known robot, in place.

    In step x its motors follow the command of step x − `earlier`, as `drive_motors` does, by the
    joints of the simulation. All the while `wrench` (6,) acts on the root: a force, and
    a moment about the CoM of the robot at the start, world axes. Other arguments as of
    `promises.predict`.
    """
    views, m, a = o.views, o.motors, o.motors.asked
    copy_into(position, views.qpos[:3])
    quaternion_of(R, views.qpos[3:7])
    copy_into(q, views.qpos[7:])
    copy_into(v, views.qvel)
    mj_step1(views.model_address, views.data_address)
    _push(o, wrench)
    written = m.written
    for x in range(first, first + count):
        then = max(min(x - earlier, written - 1), 0) % RING
        for i in range(views.ctrl.shape[0]):
            dof = m.robot.motor_dofs[i]
            torque = a.torque[then, i]
            if a.stiffness[then, i] != 0.0 or a.damping[then, i] != 0.0:
                torque += a.stiffness[then, i] * (a.target[then, i] - views.qpos[dof + 1])
                torque -= a.damping[then, i] * views.qvel[dof]
            most = o.robot.torque_limit[i]
            views.ctrl[i] = min(max(torque, -most), most)
        mj_step2(views.model_address, views.data_address)
        mj_step1(views.model_address, views.data_address)
    copy_into(views.qpos[:3], position)
    axes_of(views.qpos[3:7], R)
    copy_into(views.qpos[7:], q)
    copy_into(views.qvel, v)


@compiled
def _push(o: Rollout, wrench: np.ndarray):
    """Let a wrench about the robot's CoM act on the root: MuJoCo takes it about the root's."""
    root = o.robot.root_body
    com, at, given = o.views.subtree_com[root], o.views.xipos[root], o.views.xfrc_applied[root]
    copy_into(wrench, given)
    x, y, z = com[0] - at[0], com[1] - at[1], com[2] - at[2]
    given[3] += y * wrench[2] - z * wrench[1]
    given[4] += z * wrench[0] - x * wrench[2]
    given[5] += x * wrench[1] - y * wrench[0]
