"""A QP for large deviations of the CoM, PD for small ones [Kudoh02, Moskalev24 §1.1.1]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import AroundQP
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .pd import PDGains, StablePD, StablePDConfig


@dataclass(frozen=True)
class Kudoh02Config:
    """The QP takes over where the capture point is farther than `far` from c_ref, and hands back
    below `near` [fractions of the CoM height]; torques pass from one to the other in `blend` [s].

    `qp` brings the CoM back with the CoP in the soles; it tracks no motion but for what makes
    its solution unique.
    """

    kind: Literal["kudoh02"] = "kudoh02"
    near: float = field(default=0.02, metadata={"min": 0.0})
    far: float = field(default=0.05, metadata={"min": 0.0})
    blend: float = field(default=0.1, metadata={"above": 0.0})
    pd: PDGains = field(default_factory=PDGains)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)

    def __post_init__(self):
        if self.near > self.far:
            raise ValueError("near must not be larger than far")


class Kudoh02(AroundQP):
    """Switches by the distance of the CoM from its goal, with hysteresis.

    The paper switches by the CoM's position; the capture point is taken here, because at the
    moment of a push the CoM has not moved yet.
    """

    def __init__(self, robot: Robot, config: Kudoh02Config | None = None):
        self.config = config or Kudoh02Config()
        super().__init__(robot, self.config.qp)
        self.pd = StablePD(robot, StablePDConfig(period=self.period, gains=self.config.pd))
        self.reset()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial: start with PD."""
        super().reset(state)
        self.large = False  # whether the deviation is large
        self._qp_fraction = 0.0  # of the QP in the torques

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        away = np.linalg.norm(state.capture_point - targets.com[:2])
        limit = self.config.near if self.large else self.config.far
        self.large = bool(away > limit * self.robot.height_com)
        step = self.period / self.config.blend
        # to the QP at once, a push does not wait; back to PD in `blend`
        self._qp_fraction = 1.0 if self.large else max(self._qp_fraction - step, 0.0)
        tau = np.zeros(len(self.robot.motor_dofs))
        if self._qp_fraction > 0.0:
            tau += self._qp_fraction * self.qp.torques(state, targets)
        if self._qp_fraction < 1.0:
            tau += (1.0 - self._qp_fraction) * self.pd.torques(state, targets)
        return tau
