"""Stable PD: gains act on the positions and velocities of the next tick [Tan11]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.envs.arrays import robot_arrays
from poise.envs.copies import Copyable
from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .controller import Targets
from .pd import PDGains, holding_torques, joint_gains, motor_torques

#: Compliance of the soles in the predicted step, against soles whose rows depend on each other.
SOLE_COMPLIANCE = 1e-9


@dataclass(frozen=True)
class StablePDConfig:
    """`stable-pd`: the gains of `pd`, implicit."""

    kind: Literal["stable-pd"] = "stable-pd"
    period: float = field(default=0.004, metadata={"above": 0.0, "max": 0.05})  # [s]
    gains: PDGains = field(default_factory=PDGains)
    feedforward: bool = True


class StablePD(Copyable):
    """τ = τ_hold + K (q_ref − q − Δt v) + D (v_ref − v − Δt v̇), soles at rest.

    v̇ solves, with K and D on the joints only,

        (M + Δt D) v̇ − Jᵀ w = −h + Sᵀ (τ_hold + K (q_ref − q − Δt v) + D (v_ref − v))
        J v̇ = −J̇ v − J v / Δt

    so that gains at which explicit PD diverges stay stable, whatever the period Δt.
    """

    def __init__(self, robot: Robot, config: StablePDConfig | None = None):
        self.robot = robot
        self.config = config or StablePDConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.stiffness, self.damping = joint_gains(self.arrays, self.config.gains)

    def reset(self, state: RobotState | None = None) -> None:
        """Nothing is remembered."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        v = state.qvel[6:]
        tau = self.stiffness * (targets.q_ref - state.q - self.period * v)
        tau += self.damping * (targets.v_ref - v)
        if self.config.feedforward:
            tau += holding_torques(state)
        tau -= self.damping * self.period * self.acceleration(state, tau)[6:]
        return motor_torques(self.arrays, tau)

    def acceleration(self, state: RobotState, tau: np.ndarray) -> np.ndarray:
        """(nv,) v̇ of the next tick under joint torques `tau` (nv−6,) minus Δt D v̇."""
        nv, k = len(state.qvel), len(state.J)
        KKT, rhs = np.zeros((nv + k, nv + k)), np.zeros(nv + k)
        KKT[:nv, :nv] = state.M
        KKT[range(6, nv), range(6, nv)] += self.period * self.damping
        KKT[:nv, nv:], KKT[nv:, :nv] = -state.J.T, state.J
        KKT[range(nv, nv + k), range(nv, nv + k)] = SOLE_COMPLIANCE
        rhs[:nv] = -state.h
        rhs[6:nv] += tau
        rhs[nv:] = -state.Jdot_v - state.J_v / self.period
        return np.linalg.solve(KKT, rhs)[:nv]
