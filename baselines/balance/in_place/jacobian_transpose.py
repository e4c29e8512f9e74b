"""A virtual force at the CoM, mapped to torques by the transposed Jacobian [Notes, 9–10]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.baselines.controller import BaseController, Targets
from poise.envs.compiled.maths.vectors import rotation_vector
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .pd import PDGains, joint_gains, motor_torques
from .wrenches import joint_torques, sole_wrenches


@dataclass(frozen=True)
class JacobianTransposeConfig:
    """Unit-free: the force in m ω² per metre, the moment in m g h per radian.

    `com_damping` is a damping ratio; `root_damping` in 1/ω of `root_stiffness`.
    """

    kind: Literal["jacobian-transpose"] = "jacobian-transpose"
    period: float = field(default=0.004, metadata={"above": 0.0, "max": 0.05})  # [s]
    com_stiffness: float = field(default=4.0, metadata={"min": 0.0})
    com_damping: float = field(default=1.0, metadata={"min": 0.0})
    root_stiffness: float = field(default=0.3, metadata={"min": 0.0})
    root_damping: float = field(default=0.3, metadata={"min": 0.0})
    posture: PDGains = field(default_factory=lambda: PDGains(leg=0.1, trunk=0.5, damping=0.3))


class JacobianTranspose(BaseController):
    """τ = h − J_soleᵀ w + posture PD, w the smallest sole wrenches of the virtual wrench.

        F = m g e_z + m (s (c_ref − c) + 2 ζ √s (ċ_ref − ċ))       on the CoM
        N = k φ(R_ref Rᵀ) − d ω_root                                turning the root upright

    With one sole and no moment this is τ = J_cᵀ F of the leg's CoM Jacobian; with two, the force
    is shared. Nothing keeps w in its cone: what the ground cannot give is not given.
    """

    def __init__(self, robot: Robot, config: JacobianTransposeConfig | None = None):
        self.robot = robot
        self.config = config or JacobianTransposeConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.stiffness, self.damping = joint_gains(self.arrays, self.config.posture)

    def virtual_wrench(self, state: RobotState, targets: Targets) -> np.ndarray:
        """(6,) [F; N] about the CoM, what the ground is to press with."""
        c, units = self.config, self.arrays.units
        m, omega = units.mass, units.omega
        s = c.com_stiffness * omega**2
        damping = 2.0 * c.com_damping * np.sqrt(s)
        force = m * (s * (targets.com - state.com) + damping * (targets.com_vel - state.com_vel))
        force[2] += units.force
        k = c.root_stiffness * m * units.gravity * units.height
        rate = state.root_axes @ (targets.root_vel - state.qvel[3:6])
        turn = rotation_vector(targets.root_axes @ state.root_axes.T)
        return np.concatenate([force, k * (turn + c.root_damping / omega * rate)])

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        wrenches = sole_wrenches(state, self.virtual_wrench(state, targets))
        tau = joint_torques(state, wrenches)
        tau += self.stiffness * (targets.q_ref - state.q)
        tau += self.damping * (targets.v_ref - state.qvel[6:])
        return motor_torques(self.arrays, tau)
