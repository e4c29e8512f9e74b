"""From unit-free costs and gains to the numbers that compiled code uses for one robot."""

from typing import TYPE_CHECKING

import numpy as np

from poise.envs.physics.arrays import RobotArrays
from poise.envs.robots.robot import Robot

from .reduced_qp import QPParameters
from .wrench_cone import robot_cones

if TYPE_CHECKING:
    from .momentum_qp import MomentumQPConfig


def joint_kinds(robot: RobotArrays) -> np.ndarray:
    """(nv−6,) how many soles each joint carries: 0 free (arms), 1 leg, more: trunk."""
    carried = np.zeros(len(robot.q_standing), dtype=int)
    for chain, length in zip(robot.chain, robot.chain_length, strict=True):
        for dof in chain[:length]:
            if dof >= 6:
                carried[dof - 6] += 1
    return carried


def qp_parameters(robot: Robot, arrays: RobotArrays, config: "MomentumQPConfig") -> QPParameters:
    """Scale `config` by the robot's mass m and CoM height h (see `tasks.py`)."""
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
        accel_floor=1e-8 / omega**4,
        sole_damping=config.contact.damping * omega,
        cone=robot_cones(robot, config.contact.friction_share, config.contact.polygon_share),
        torque_limit=torque_limit,
        brake_accel=config.joint.brake * omega**2,
        brake_horizon=config.joint.horizon / omega,
        brake_floor=config.joint.floor * omega**2,
        soft_root=config.root == "soft",
        root_weight=config.root_weight / np.repeat([force, moment], 3) ** 2,
    )
