"""Position servos of a robot's motors: gains, the posture that they hold, and their torques."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.legs import standing_data
from poise.envs.physics.motor_bus import ask_servo
from poise.envs.physics.simulation import World
from poise.envs.robots.description import match_names
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose

POSITIVE, NOT_NEGATIVE = {"above": 0.0}, {"min": 0.0}


@dataclass(frozen=True)
class ServoConfig:
    """The gains of the servos, τ = K (q* − q) − D q̇, and what an action moves.

    By default K is the motor's limit over `deflection`. A joint of the legs has at least `carry`
    times what holds half of the body upright above it, ½ m g h sin β: h the height of the CoM over
    the joint, β the angle of its axis from the vertical. D = 2 `damping_ratio` √(K I), with
    I = 1/(M⁻¹)_jj, the inertia that the joint feels when all others are free. Mappings are from
    joint names, or patterns such as ``*_ankle_y``, and win.

    Attributes:
        deflection: Error at which a servo gives its motor's limit [rad].
        carry: Stiffness of the legs' joints at least, over what holds half of the body upright
            above them.
        damping_ratio: Damping of a servo, 1 is critical.
        stiffness: Stiffness K of joints by name or pattern, in place of that [N·m/rad].
        damping: Damping D of joints by name or pattern, in place of that [N·m·s/rad].
        reach: How far an action of 1 moves the target of joints by name or pattern [rad].
    """

    deflection: float = field(default=0.3, metadata=POSITIVE)
    carry: float = field(default=2.0, metadata=NOT_NEGATIVE)
    damping_ratio: float = field(default=1.0, metadata=NOT_NEGATIVE)
    stiffness: dict[str, float] = field(default_factory=dict, metadata=POSITIVE)
    damping: dict[str, float] = field(default_factory=dict, metadata=NOT_NEGATIVE)
    reach: dict[str, float] = field(default_factory=lambda: {"*": 1.0}, metadata=POSITIVE)


@dataclass(frozen=True, eq=False)
class Servos(Block):
    """A servo for each motor (nu)."""

    dofs: np.ndarray  # (nu,) int: degree of freedom in qvel; one more in qpos
    stiffness: np.ndarray  # (nu,) [N·m/rad]
    damping: np.ndarray  # (nu,) [N·m·s/rad]
    limit: np.ndarray  # (nu,) [N·m]
    hold: np.ndarray  # (nu,) target of action zero [rad]
    reach: np.ndarray  # (nu,) [rad]
    target: np.ndarray  # (nu,) q* [rad]


@compiled
def pd_torque(
    stiffness: float, damping: float, limit: float, error: float, velocity: float
) -> float:
    """τ = K e − D q̇ within ± the limit, of the error e = q* − q [rad]."""
    torque = stiffness * error
    torque -= damping * velocity
    return min(max(torque, -limit), limit)


@compiled
def aim(servos: Servos, action: np.ndarray):
    """q* = hold + reach · action (nu,)."""
    for i in range(servos.target.shape[0]):
        servos.target[i] = servos.hold[i] + servos.reach[i] * action[i]


@compiled
def servo_torque(servos: Servos, world: World, i: int) -> float:
    """The torque of the servo of motor i, by what its own encoder reads [N·m]."""
    dof = servos.dofs[i]
    if world.bus.q.shape[0] > 0:
        position, velocity = world.bus.q[dof - 6], world.bus.dq[dof - 6]
    else:
        position, velocity = world.views.qpos[dof + 1], world.views.qvel[dof]
    return pd_torque(
        servos.stiffness[i], servos.damping[i], servos.limit[i],
        servos.target[i] - position, velocity,
    )  # fmt: skip


@compiled
def drive(servos: Servos, world: World):
    """The servos' torques in `views.ctrl`."""
    for i in range(servos.target.shape[0]):
        world.views.ctrl[i] = servo_torque(servos, world, i)
    hand_to_motors(servos, world, 1.0, servos.target)


@compiled
def hand_to_motors(servos: Servos, world: World, part: float, torques: np.ndarray):
    """Where the motors are real, let them run the servos: `part` of these, and the rest of the
    torques (nj,) [N·m]."""
    if world.bus.q.shape[0] > 0:
        for i in range(servos.target.shape[0]):
            torque = (1.0 - part) * torques[servos.dofs[i] - 6] if part < 1.0 else 0.0
            ask_servo(
                world.bus, i, torque, servos.target[i],
                part * servos.stiffness[i], part * servos.damping[i],
            )  # fmt: skip


def make_servos(robot: Robot, config: ServoConfig) -> Servos:
    """The servos of `robot`, whose targets hold its standing posture until they are moved.

    Raises ConfigError for a joint or pattern that no motor drives, or a motor without `reach`.
    """
    dofs = np.array(robot.motor_dofs, dtype=np.int64)
    names = [robot.joint_names[dof - 6] for dof in dofs]
    data = standing_data(robot)
    stiffness = np.maximum(robot.torque_limit / config.deflection, _carrying(robot, data, config))
    _replace(stiffness, config.stiffness, names, "servos.stiffness")
    inertia = _free_inertia(robot, data)
    damping = 2.0 * config.damping_ratio * np.sqrt(stiffness * inertia)
    _replace(damping, config.damping, names, "servos.damping")
    reach = np.full(len(names), np.nan)
    _replace(reach, config.reach, names, "servos.reach")
    if np.isnan(reach).any():
        raise ConfigError(
            f"none for {', '.join(np.array(names)[np.isnan(reach)])}", field="servos.reach"
        )
    hold = robot.standing_qpos[dofs + 1] + holding_torques(robot) / stiffness
    return Servos(
        dofs,
        stiffness,
        damping,
        np.array(robot.torque_limit),
        hold,
        reach,
        guarded_zeros(len(names)),
    )


def holding_torques(robot: Robot) -> np.ndarray:
    """(nu,) torques [N·m] that hold the standing posture at rest, each sole loaded below the CoM.

    τ = g(q) − τ_passive − Σ J_iᵀ f_i: the ground carries the weight at two points, one for each
    foot, at the CoM's place forward and the soles' places to the side.
    """
    model, data = robot.model, standing_data(robot)
    com = data.subtree_com[robot.root_body_id]
    soles = [sole_pose(data, sole)[0] for sole in robot.soles]
    fraction = np.clip((com[1] - soles[0][1]) / (soles[1][1] - soles[0][1]), 0.0, 1.0)
    torques = data.qfrc_bias - data.qfrc_passive
    jacobian = np.zeros((3, model.nv))
    for sole, place, part in zip(robot.soles, soles, (1.0 - fraction, fraction), strict=True):
        point = np.array([com[0], place[1], 0.0])
        mujoco.mj_jac(model, data, jacobian, None, point, sole.body_id)
        torques = torques - jacobian[2] * part * robot.units.force
    limit = robot.torque_limit
    return np.clip(torques[robot.motor_dofs], -limit, limit)


def _free_inertia(robot: Robot, data: mujoco.MjData) -> np.ndarray:
    """(nu,) 1/(M⁻¹)_jj of the driven joints [kg·m²]."""
    inverse = np.zeros((robot.model.nv, robot.model.nv))
    mujoco.mj_solveM(robot.model, data, inverse, np.eye(robot.model.nv))
    return 1.0 / np.diag(inverse)[robot.motor_dofs]


def _carrying(robot: Robot, data: mujoco.MjData, config: ServoConfig) -> np.ndarray:
    """(nu,) the least stiffness of joints between root and soles, 0 of others [N·m/rad]."""
    model, least = robot.model, np.zeros(robot.model.nv)
    com = data.subtree_com[robot.root_body_id]
    for sole in robot.soles:
        body = sole.body_id
        while body != robot.root_body_id:
            first = model.body_jntadr[body]
            for joint in range(first, first + model.body_jntnum[body]):
                lever = max(com[2] - data.xanchor[joint, 2], 0.0)
                lever *= np.linalg.norm(data.xaxis[joint, :2])
                least[model.jnt_dofadr[joint]] = 0.5 * config.carry * robot.units.force * lever
            body = model.body_parentid[body]
    return least[robot.motor_dofs]


def _replace(values: np.ndarray, by: dict[str, float], names: list[str], field: str) -> None:
    """Write what `by` has for these joints into `values`."""
    for name, value in match_names(by, names, "environment", field).items():
        values[names.index(name)] = value
