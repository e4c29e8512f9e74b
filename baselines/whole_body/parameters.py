"""From unit-free costs and gains to the numbers that compiled code uses for one robot."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.solvers.null_space import short_legs
from poise.envs.compiled.block import Block
from poise.envs.physics.arrays import RobotArrays, sole_chains
from poise.envs.robots.robot import Robot

from .contacts.wrench_cone import robot_cones
from .gains import JointLimit, MomentumQPConfig

# A pelvis held by soles that are turned by 0.02 rad is as good as free; by 0.2 rad it is held.
WEAKEST_WEIGHT = 3000.0  # per (acceleration / g)² or (angular acceleration / ω²)²


@dataclass(frozen=True, eq=False)
class QPParameters(Block):
    """The numbers of tasks, contacts and limits in SI units, for nv dofs and nc soles."""

    accel_weight: np.ndarray  # (nv,) posture
    far_share: float  # the fraction of these weights with the CoM far from c_ref
    far_distance: float  # [m]
    stiffness: np.ndarray  # (nv,) k_t [1/s²]
    damping: np.ndarray  # (nv,) d_t [1/s]
    com_weight: np.ndarray  # (3,) ω_c per N²
    com_stiffness: np.ndarray  # (3,) s_c [1/s²]
    com_damping: np.ndarray  # (3,) d_c [1/s]
    angular_weight: np.ndarray  # (3,) ω_p per (N·m)²
    angular_damping: float  # k_L [1/s]
    cop_stiffness: float  # s_p [1/s²]
    cop_damping: float  # d_p [1/s]
    cop_horizon: float  # [s] over which p̈_des is integrated
    force_weight: float  # per N²
    moment_weight: float  # per (N·m)²
    torque_weight: np.ndarray  # (nv−6,) per (N·m)²
    weakest_weight: np.ndarray  # (2,) of J's weakest row: per (m/s²)² and per (rad/s²)²; or 0
    accel_floor: float  # per (unit of z)²
    sole_damping: float  # k_v [1/s]
    cone: np.ndarray  # (nc, rows, 6) cone · w_sole ≤ 0
    torque_limit: np.ndarray  # (nv−6,) 0 for a joint without a motor
    brakes: bool  # false: nothing stops joints before their limits
    brake_accel: float  # [rad/s²] that braking may assume
    brake_horizon: float  # [s]
    brake_floor: float  # [rad/s²] braking is never asked to exceed
    soft_root: bool
    root_weight: np.ndarray  # (6,) ω_root per N² and per (N·m)²


def joint_kinds(robot: RobotArrays) -> np.ndarray:
    """(nv−6,) how many soles each joint carries: 0 free (arms), 1 leg, more: trunk."""
    carried = np.zeros(len(robot.q_standing), dtype=int)
    for chain, length in zip(robot.chain, robot.chain_length, strict=True):
        for dof in chain[:length]:
            if dof >= 6:
                carried[dof - 6] += 1
    return carried


def qp_parameters(robot: Robot, arrays: RobotArrays, config: MomentumQPConfig) -> QPParameters:
    """Scale `config` by the robot's mass m and CoM height h (see `gains.py`)."""
    units = arrays.units
    h, omega, force, moment = units.height, units.omega, units.force, units.moment
    kinds = joint_kinds(arrays)
    nj = len(kinds)
    posture, com, cop = config.posture, config.com, config.cop

    weight = np.choose(
        np.minimum(kinds, 2), [posture.free_weight, posture.leg_weight, posture.trunk_weight]
    )
    if len(robot.soles) == 1:  # with one sole nothing tells its leg from a trunk
        weight = np.where(kinds > 0, posture.leg_weight, posture.free_weight)
    accel_weight = np.concatenate([np.zeros(3), np.full(3, posture.root_weight), weight])
    gain = np.where(kinds == 0, posture.free_stiffness, posture.stiffness)
    stiffness = np.concatenate([np.zeros(3), np.full(3, posture.root_stiffness), gain])

    torque_limit = np.zeros(nj)  # a joint without a motor has none
    torque_limit[arrays.motor_dofs - 6] = config.torque.share * arrays.torque_limit
    joint = config.joint or JointLimit()
    weakest = WEAKEST_WEIGHT if short_legs(sole_chains(arrays)) else 0.0
    com_stiffness = np.array([com.stiffness, com.stiffness, com.height_stiffness])
    return QPParameters(
        accel_weight=accel_weight / omega**4,
        far_share=posture.far_share,
        far_distance=posture.far_distance * h,
        stiffness=stiffness * omega**2,
        damping=2.0 * posture.damping_ratio * np.sqrt(stiffness) * omega,
        com_weight=np.array([com.weight, com.weight, com.height_weight]) / force**2,
        com_stiffness=com_stiffness * omega**2,
        com_damping=2.0 * com.damping_ratio * np.sqrt(com_stiffness) * omega,
        angular_weight=np.array([cop.weight, cop.weight, cop.yaw_weight]) / moment**2,
        angular_damping=cop.angular_damping * omega,
        cop_stiffness=cop.stiffness * omega**2,
        cop_damping=cop.damping * omega,
        cop_horizon=cop.horizon / omega,
        force_weight=config.contact.force_weight / force**2,
        moment_weight=config.contact.moment_weight / moment**2,
        torque_weight=np.full(nj, config.torque.weight / moment**2),
        weakest_weight=weakest / np.array([arrays.gravity**2, omega**4]),
        accel_floor=1e-8 / omega**4,
        sole_damping=config.contact.damping * omega,
        cone=robot_cones(robot, config.contact.friction_share, config.contact.polygon_share),
        torque_limit=torque_limit,
        brakes=config.joint is not None,
        brake_accel=joint.brake * omega**2,
        brake_horizon=joint.horizon / omega,
        brake_floor=joint.floor * omega**2,
        soft_root=config.root == "soft",
        root_weight=config.root_weight / np.repeat([force, moment], 3) ** 2,
    )
