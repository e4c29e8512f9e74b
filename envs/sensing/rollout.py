"""The state led on by a simulation of the known robot, with what its motors were asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import axes_of, copy_into, quaternion_of
from poise.envs.compiled.mujoco_calls import mj_step1, mj_step2
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot, on_terrain
from poise.envs.terrain.terrain import Terrain

from .motors import DAMPING, STIFFNESS, TARGET, TORQUE, Motors


@dataclass(frozen=True, eq=False)
class Rollout(Block):
    """A simulation of the known robot, of which nothing is remembered."""

    robot: RobotArrays
    views: SimViews
    motors: Motors  # what they were asked for, which the computer knows


def make_rollout(robot: Robot, terrain: Terrain, motors: Motors) -> Rollout:
    """The rollout of `robot` on `terrain`."""
    simulation = Simulation(on_terrain(robot, terrain))
    return Rollout(simulation.arrays, simulation.views, motors)


@compiled
def roll_out(
    o: Rollout, first: int, count: int, earlier: int,
    position: np.ndarray, R: np.ndarray, q: np.ndarray, v: np.ndarray,
):  # fmt: skip
    """Lead a state on by `count` physics steps of the known robot, in place.

    In the step x its motors follow what was asked for in step x − `earlier`, as `drive_motors` has
    it, by the joints of the simulation. Arguments as of `predict`.
    """
    views, m, n = o.views, o.motors, o.motors.asked.shape[0]
    copy_into(position, views.qpos[:3])
    quaternion_of(R, views.qpos[3:7])
    copy_into(q, views.qpos[7:])
    copy_into(v, views.qvel)
    mj_step1(views.model_address, views.data_address)
    written = m.written[0]
    for x in range(first, first + count):
        asked = m.asked[max(min(x - earlier, written - 1), 0) % n]
        for i in range(views.ctrl.shape[0]):
            dof = m.robot.motor_dofs[i]
            torque = asked[TORQUE, i]
            if asked[STIFFNESS, i] != 0.0 or asked[DAMPING, i] != 0.0:
                torque += asked[STIFFNESS, i] * (asked[TARGET, i] - views.qpos[dof + 1])
                torque -= asked[DAMPING, i] * views.qvel[dof]
            most = o.robot.torque_limit[i]
            views.ctrl[i] = min(max(torque, -most), most)
        mj_step2(views.model_address, views.data_address)
        mj_step1(views.model_address, views.data_address)
    copy_into(views.qpos[:3], position)
    axes_of(views.qpos[3:7], R)
    copy_into(views.qpos[7:], q)
    copy_into(views.qvel, v)
