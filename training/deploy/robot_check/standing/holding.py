"""The fraction of its torque limits that holds a posture: inverse dynamics at rest."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import linprog

from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot


@dataclass(frozen=True)
class Holding:
    """The torques that hold a posture, as a fraction of the motors' limits.

    Attributes:
        torque_fraction: the largest |τ|/τ_max of all motors, for the forces of the ground that make
            it least; above 1 the motors cannot. None: no forces of the ground hold the robot.
        joint: where it is the largest.
    """

    torque_fraction: float | None
    joint: str | None

    @property
    def possible(self) -> bool:
        """True where the motors can hold the posture."""
        return self.torque_fraction is not None and self.torque_fraction <= 1.0


def holding(robot: Robot, qpos: np.ndarray, soles: Sequence[int]) -> Holding:
    """Return the torques τ that hold `qpos` at rest on these soles.

    S τ = g(q) − τ_passive − Jᵀ f, with forces f at the soles' corners within pyramids inside of
    their friction cones; a joint without a motor bears its friction loss alone. A linear program
    finds the f for which the largest |τ|/τ_max is least.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    needed = data.qfrc_bias - data.qfrc_passive
    lift = np.vstack([_corner_jacobians(robot, data, sole) for sole in soles]).T  # (nv, 4 k)
    limit = np.zeros(model.nv)
    limit[robot.motor_dofs] = robot.torque_limit
    loss = np.where(limit > 0.0, 0.0, model.dof_frictionloss)
    rounding = 1e-6 * robot.units.moment  # that the solver may leave in a row [N, N·m]
    found = linprog(
        c=[*np.zeros(lift.shape[1]), 1.0],
        A_ub=np.vstack([np.column_stack([sign * lift, -limit]) for sign in (1.0, -1.0)]),
        b_ub=np.concatenate([sign * needed + loss + rounding for sign in (1.0, -1.0)]),
    )
    if not found.success:
        return Holding(None, None)
    torque = (needed - lift @ found.x[:-1])[robot.motor_dofs]
    worst = int(np.argmax(np.abs(torque) / robot.torque_limit))
    name = robot.joint_names[robot.motor_dofs[worst] - 6]
    return Holding(float(abs(torque[worst]) / robot.torque_limit[worst]), name)


def _corner_jacobians(robot: Robot, data: mujoco.MjData, sole: int) -> np.ndarray:
    """Return (4 k, nv) Jᵀ of the edges of the friction pyramids at the sole's k corners."""
    foot, model = robot.soles[sole], robot.model
    friction = contact_friction(model, robot.ground_geom_id, foot.geom_ids) / np.sqrt(2.0)
    edges = [[x * friction, y * friction, 1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    rotation, rows = data.xmat[foot.body_id].reshape(3, 3), []
    for corner in foot.polygon:
        local = foot.position + foot.rotation @ [*corner, 0.0]
        jacobian = np.zeros((3, model.nv))
        point = data.xpos[foot.body_id] + rotation @ local
        mujoco.mj_jac(model, data, jacobian, None, point, foot.body_id)
        rows.append(np.array(edges) @ jacobian)
    return np.vstack(rows)
