"""The joints of a leg with one knee, told from each other by how far down they are."""

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot


@dataclass(frozen=True)
class LegJoints:
    """Joints of a leg, by index: on the way to the thigh, the hip's own, the knee, the ankle."""

    upper: np.ndarray
    hip: np.ndarray
    knee: np.ndarray
    ankle: np.ndarray
    bend: np.ndarray  # what a bend of 1 adds to the knee


def leg_joints(robot: Robot, sole: int) -> LegJoints:
    """Joints of a leg by how far down they are: in the upper quarter, in the lower one, between."""
    model = robot.model
    data = mujoco.MjData(model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)

    def chain(body: int) -> list[int]:
        joints: list[int] = []
        while body != robot.root_body_id:
            first = model.body_jntadr[body]
            joints = [first + k for k in range(model.body_jntnum[body])] + joints
            body = model.body_parentid[body]
        return joints

    mine, other = (chain(robot.soles[i].body_id) for i in (sole, 1 - sole))
    own = np.array([j for j in mine if j not in other])
    top, foot = data.xanchor[own[0]], data.xanchor[own[-1]]
    depth = (data.xanchor[own] - top) @ (foot - top) / ((foot - top) @ (foot - top))
    knee = own[(depth > 0.25) & (depth < 0.75)]
    if len(knee) != 1:
        raise ConfigError(f"needs legs with a knee, unlike {robot.name!r}", field="controller")
    shortens = np.cross(data.xaxis[knee], foot - data.xanchor[knee]) @ (top - foot)
    return LegJoints(
        upper=np.array([j for j in mine if j < knee[0]]) - 1,  # the first joint is the root's
        hip=own[depth <= 0.25] - 1,
        knee=knee - 1,
        ankle=own[depth >= 0.75] - 1,
        bend=np.sign(shortens),
    )
