"""Momentum QPs whose horizontal CoM acceleration and CoP come from a pendulum model."""

from abc import ABC, abstractmethod

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import AroundQP
from poise.baselines.whole_body.tasks.com import CoMBlock
from poise.configs.errors import ConfigError
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot


class Guided(AroundQP, ABC):
    """c̈_des = ω² (c − p) and p_ref = p, with p chosen by `cop` each tick.

    The linear inverted pendulum c̈ = ω² (c − p) [Koolen12]. In the plane the QP gets
    c̈_ref = c̈_des − s_c (c_ref − c) − d_c (ċ_ref − ċ), which takes its own CoM gains out; c_ref
    stays, for the posture's weights go by its distance.
    """

    def __init__(self, robot: Robot, qp: MomentumQPConfig):
        super().__init__(robot, qp)
        task = self.qp.tasks.get("com")
        if task is None or not isinstance(task.block, CoMBlock):
            raise ConfigError(
                "must be a task of kind 'com', whose gains are taken out", field="qp.com"
            )
        self._com: CoMBlock = task.block
        self._guided: Targets | None = None

    @abstractmethod
    def cop(self, state: RobotState, targets: Targets) -> np.ndarray:
        """(2,) p [m], the CoP that the pendulum is to have."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        if self._guided is None:
            self._guided = Targets.standing(self.robot, state)
        guided = self._guided
        guided.take(targets)
        p = self.cop(state, targets)
        gains = self._com
        guided.com_acc[:2] += (
            state.omega**2 * (state.com[:2] - p)
            - gains.stiffness[:2] * (targets.com[:2] - state.com[:2])
            - gains.damping[:2] * (targets.com_vel[:2] - state.com_vel[:2])
        )
        guided.cop[:] = p
        return self.qp.torques(state, guided)
