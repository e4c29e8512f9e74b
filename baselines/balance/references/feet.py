"""The feet of a robot as it stands: where they are, and what their ankles can bear."""

import mujoco
import numpy as np

from poise.envs.compiled.maths.polygons import clipped
from poise.envs.robots.robot import Robot


def nominal_feet(robot: Robot) -> np.ndarray:
    """(2, 3) middles of the soles in the standing posture, which faces along x [m]."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(robot.model, data)
    feet = [data.xpos[s.body_id] + data.xmat[s.body_id].reshape(3, 3) @ s.position
            for s in robot.soles]  # fmt: skip
    return np.array(feet)


def foot_signs(robot: Robot) -> np.ndarray:
    """(2,) 1 for the left foot, −1 for the right one, in the standing posture."""
    feet = nominal_feet(robot)
    sign = 1.0 if feet[0, 1] > feet[1, 1] else -1.0
    return np.array([sign, -sign])


def ankle_limits(robot: Robot, sole: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """N (k, 2), o (k,), b (k,): |N p − o| ≤ b/λ for a CoP p [m, sole frame] under a load of λ m g.

    One row for each motor joint of the foot itself: the moment of a vertical force about its axis
    in the standing posture, over its torque limit.
    """
    model, foot = robot.model, robot.soles[sole]
    data = mujoco.MjData(model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    body = foot.body_id
    R = data.xmat[body].reshape(3, 3) @ foot.rotation
    point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ foot.position
    weight = robot.units.force
    normals, offsets, bounds = [], [], []
    for joint in range(model.njnt):
        dof = model.jnt_dofadr[joint]
        motor = np.flatnonzero(np.asarray(robot.motor_dofs) == dof)
        if model.jnt_bodyid[joint] != body or len(motor) == 0:
            continue
        axis, anchor = data.xaxis[joint], data.xanchor[joint]
        # (axis × (point + R p − anchor))_z, affine in p
        offsets.append(-np.cross(axis, point - anchor)[2])
        normals.append([np.cross(axis, R[:, a])[2] for a in range(2)])
        bounds.append(robot.torque_limit[motor[0]] / weight)
    return np.reshape(normals, (-1, 2)), np.array(offsets), np.array(bounds)


def bearing_polygon(robot: Robot, sole: int, load: float, fraction: float) -> np.ndarray:
    """(k, 2) where a sole under a `load` [m g] can have its CoP, in its own frame [m].

    Only `fraction` of the polygon and of the ankles' torques counts.
    """
    polygon = fraction * robot.soles[sole].polygon
    for normal, offset, bound in zip(*ankle_limits(robot, sole), strict=True):
        room = fraction * bound / max(load, 1e-3)
        polygon = clipped(polygon, normal, offset + room)
        polygon = clipped(polygon, -normal, room - offset)
    return polygon
