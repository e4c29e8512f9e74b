"""What controllers built around one momentum QP have in common."""

import numpy as np

from poise.envs.copies import Copyable
from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .momentum_qp import MomentumQP, MomentumQPConfig


class AroundQP(Copyable):
    """Holds the QP in `qp` and tells what it tells: period, CoM offset, failures, root wrench."""

    def __init__(self, robot: Robot, qp: MomentumQPConfig):
        self.robot = robot
        self.qp = MomentumQP(robot, qp)
        self.period, self.com_offset = self.qp.period, self.qp.com_offset

    @property
    def failures(self) -> int:
        """Ticks since the reset at which the QP was not solved."""
        return self.qp.failures

    @property
    def root_wrench(self) -> np.ndarray:
        """(6,) u_root of the QP's last tick, soft root only."""
        return self.qp.root_wrench

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        self.qp.reset(state)
