"""What of a robot's model the physics step, the floor or a flag make other than it seems."""

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.physics.legs import standing_data
from poise.envs.robots.actuators import proposed_armature
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot

LIGHT = 0.1  # [rad] or [m] that a joint may move within one physics step at full torque
#: flags of a model that switch off what may matter; those that must be on are turned on
FLAGS = ("limit", "frictionloss", "spring", "damper", "equality")


@dataclass(frozen=True)
class JointDynamics:
    """A joint with a motor.

    Attributes:
        jump: how far full torque moves it from rest within one physics step, its neighbours free:
            τ_max (M⁻¹)_ii Δt² [rad], of a slide [m].
        armature: of its rotor [kg·m²], of a slide [kg].
        proposed: the armature that its torque limit and the robot's mass suggest.
    """

    jump: float
    armature: float
    proposed: float


@dataclass(frozen=True)
class Dynamics:
    """Properties of the model that matter, other than masses and shapes.

    Attributes:
        timestep: of the physics [s].
        joints: joint → see there.
        friction: sliding coefficient of the soles on the ground, as MuJoCo combines it; 0 where
            contacts have one dimension.
        friction_ground, friction_soles: what the model says of the ground, and of each sole, foot →
            coefficient.
        disabled: flags of the model that switch off what may matter, of `FLAGS`.
        scenery: other parts of the world that the robot may touch.
    """

    timestep: float
    joints: dict[str, JointDynamics]
    friction: float
    friction_ground: float
    friction_soles: dict[str, float]
    disabled: tuple[str, ...]
    scenery: tuple[str, ...]


def dynamics(robot: Robot) -> Dynamics:
    """Of a robot in its standing posture."""
    model, ground = robot.model, robot.ground_geom_id
    geoms = [geom for sole in robot.soles for geom in sole.geom_ids]
    slips = model.npair == 0 and model.geom_condim[[ground, *geoms]].max() == 1
    return Dynamics(
        timestep=float(model.opt.timestep),
        joints=_joints(robot),
        friction=0.0 if slips else contact_friction(model, ground, geoms),
        friction_ground=float(model.geom_friction[ground, 0]),
        friction_soles={sole.name: float(model.geom_friction[list(sole.geom_ids), 0].min())
                        for sole in robot.soles},
        disabled=tuple(name for name in FLAGS if model.opt.disableflags
                       & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name.upper()}"))),
        scenery=_scenery(robot),
    )  # fmt: skip


def _joints(robot: Robot) -> dict[str, JointDynamics]:
    model, data = robot.model, standing_data(robot)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    mobility = np.diag(np.linalg.inv(inertia))
    found = {}
    for dof, limit in zip(robot.motor_dofs, robot.torque_limit, strict=True):
        found[robot.joint_names[dof - 6]] = JointDynamics(
            jump=float(limit * mobility[dof] * model.opt.timestep**2),
            armature=float(model.dof_armature[dof]),
            proposed=proposed_armature(float(limit), robot.mass),
        )
    return found


def _scenery(robot: Robot) -> tuple[str, ...]:
    """Return the names of geoms of the world, other than the ground, that collide with anything."""
    model, found = robot.model, []
    for geom in range(model.ngeom):
        fixed = model.body_weldid[model.geom_bodyid[geom]] == 0
        solid = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if fixed and solid and geom != robot.ground_geom_id and robot.terrain.flat:
            found.append(model.geom(geom).name or f"geom {geom}")
    return tuple(found)
