"""Momentum QP without torques, then inverse dynamics: the motors clip [Macchietto09]."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import AroundQP
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

UNBOUND = 1e3  # times the motors' limits: rows that never bind


@dataclass(frozen=True)
class Macchietto09Config:
    """The QP's torque limits and its cost on torques are not used: torques are no unknowns."""

    kind: Literal["macchietto09"] = "macchietto09"
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class Macchietto09(AroundQP):
    """min h_t + h_c + h_p over v̇ and w, soles at rest; τ = S (M v̇ + h − Jᵀw), clipped to τ_max.

    What the accelerations ask beyond a motor's limit is lost, and nothing else makes up for it:
    in `momentum-qp` the limits are part of the problem, and other joints take over.
    """

    def __init__(self, robot: Robot, config: Macchietto09Config | None = None):
        self.config = config or Macchietto09Config()
        torque = replace(self.config.qp.torque, weight=0.0)
        super().__init__(robot, replace(self.config.qp, torque=torque))
        self.qp.parameters.torque_limit[:] *= UNBOUND

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        limit = self.robot.torque_limit
        return np.clip(self.qp.torques(state, targets), -limit, limit)
