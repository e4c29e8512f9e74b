"""CoM and motion tracking in one QP, without CoP control [Abe07, Moskalev24 §1.1.2]."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.momentum_qp import AroundQP, MomentumQPConfig
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot


@dataclass(frozen=True)
class Abe07Config:
    """The tracking weight falls to `floor` of itself as the CoM leaves: over `distance` [share of
    the CoM height] of the CoM from c_ref. The QP's CoP weight is not used: it is 0 here."""

    kind: Literal["abe07"] = "abe07"
    distance: float = field(default=0.05, metadata={"above": 0.0})
    floor: float = field(default=0.1, metadata={"above": 0.0, "max": 1.0})
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class Abe07(AroundQP):
    """min β h_t + h_c: no angular momentum, β = floor + (1 − floor) exp(−(|c − c_ref| / d)²).

    A CoM far from its goal counts more than the motion; near it, the motion is followed again.
    """

    def __init__(self, robot: Robot, config: Abe07Config | None = None):
        self.config = config or Abe07Config()
        cop = replace(self.config.qp.cop, weight=0.0, yaw_weight=0.0)
        posture = replace(self.config.qp.posture, far_share=1.0)  # β is applied here
        super().__init__(robot, replace(self.config.qp, cop=cop, posture=posture))
        self._tracking = self.qp.parameters.accel_weight.copy()

    def tracking(self, state: RobotState, targets: Targets) -> float:
        """β of this state."""
        away = np.linalg.norm(state.com[:2] - targets.com[:2])
        share = np.exp(-((away / (self.config.distance * self.robot.height_com)) ** 2))
        return float(self.config.floor + (1.0 - self.config.floor) * share)

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        self.qp.parameters.accel_weight[:] = self.tracking(state, targets) * self._tracking
        return self.qp.torques(state, targets)
