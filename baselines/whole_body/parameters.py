"""From unit-free gains of contacts and built-in limits to the numbers of compiled code."""

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
    """The numbers of contacts and built-in limits in SI units, for nv dofs and nc soles."""

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


def qp_parameters(robot: Robot, arrays: RobotArrays, config: MomentumQPConfig) -> QPParameters:
    """Scale `config` by the robot's mass m and CoM height h (see `gains.py`)."""
    omega = arrays.units.omega
    torque_limit = np.zeros(len(robot.joint_names))  # a joint without a motor has none
    torque_limit[arrays.motor_dofs - 6] = config.torque.share * arrays.torque_limit
    joint = config.joint or JointLimit()
    weakest = WEAKEST_WEIGHT if short_legs(sole_chains(arrays)) else 0.0
    return QPParameters(
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
    )
