"""A momentum QP whose horizontal CoM acceleration and CoP come from a pendulum model."""

from abc import ABC, abstractmethod
from dataclasses import fields

import numpy as np

from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .controller import Targets
from .momentum_qp import MomentumQP, MomentumQPConfig


class Guided(ABC):
    """c̈_des = ω² (c − p) and p_ref = p, with p chosen by `cop` each tick.

    The linear inverted pendulum c̈ = ω² (c − p) [Koolen12]. The QP gets c_ref = c, ċ_ref = ċ and
    c̈_ref = c̈_des in the plane, so that its own CoM gains act on the height only.
    """

    def __init__(self, robot: Robot, qp: MomentumQPConfig):
        self.robot = robot
        self.qp = MomentumQP(robot, qp)
        self.period, self.com_offset = self.qp.period, self.qp.com_offset
        self._guided: Targets | None = None

    @property
    def failures(self) -> int:
        """Ticks since the reset at which the QP was not solved."""
        return self.qp.failures

    @property
    def root_wrench(self) -> np.ndarray:
        """(6,) u_root of the last tick, soft root only."""
        return self.qp.root_wrench

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        self.qp.reset(state)

    @abstractmethod
    def cop(self, state: RobotState, targets: Targets) -> np.ndarray:
        """(2,) p [m], the CoP that the pendulum is to have."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        if self._guided is None:
            self._guided = Targets.standing(self.robot, state)
        guided = self._guided
        for item in fields(Targets):
            getattr(guided, item.name)[:] = getattr(targets, item.name)
        p = self.cop(state, targets)
        guided.com[:2], guided.com_vel[:2] = state.com[:2], state.com_vel[:2]
        guided.com_acc[:2] = state.omega**2 * (state.com[:2] - p) + targets.com_acc[:2]
        guided.cop[:] = p
        return self.qp.torques(state, guided)
