"""Momentum QPs whose horizontal CoM acceleration and CoP come from a pendulum model.

CoP from the instantaneous capture point, kept in the support polygon [Englsberger11]; LQR on the
linear inverted pendulum [Stephens07], which knows no support polygon.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.linalg import solve_continuous_are

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import AroundQP
from poise.envs.compiled.maths.polygons import nearest_inside, shrunk
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
        gains = self.qp.parameters
        guided.com_acc[:2] += (
            state.omega**2 * (state.com[:2] - p)
            - gains.com_stiffness[:2] * (targets.com[:2] - state.com[:2])
            - gains.com_damping[:2] * (targets.com_vel[:2] - state.com_vel[:2])
        )
        guided.cop[:] = p
        return self.qp.torques(state, guided)


@dataclass(frozen=True)
class CapturePointConfig:
    """`gain` k of the capture point's error; `share` of the polygon that the CoP may use."""

    kind: Literal["capture-point"] = "capture-point"
    gain: float = field(default=1.0, metadata={"above": 0.0})
    share: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class CapturePoint(Guided):
    """p = ξ + k (ξ − ξ_ref), the nearest point of the polygon where that lies outside.

    Inside, ξ̇ = ω (ξ − p) = −k ω (ξ − ξ_ref): the capture point returns at the rate k ω.
    """

    def __init__(self, robot: Robot, config: CapturePointConfig | None = None):
        self.config = config or CapturePointConfig()
        super().__init__(robot, self.config.qp)

    def cop(self, state: RobotState, targets: Targets) -> np.ndarray:
        """(2,) p [m]."""
        reference = targets.com[:2] + targets.com_vel[:2] / state.omega
        desired = state.capture_point + self.config.gain * (state.capture_point - reference)
        return nearest_inside(shrunk(state.support_polygon, self.config.share), desired)


@dataclass(frozen=True)
class LQRLIPConfig:
    """Costs of CoM position and of velocity/ω, both over that of the CoP, all in metres."""

    kind: Literal["lqr-lip"] = "lqr-lip"
    position: float = field(default=1.0, metadata={"min": 0.0})
    velocity: float = field(default=1.0, metadata={"min": 0.0})
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


def lqr_gain(position: float, velocity: float) -> np.ndarray:
    """(2,) K of p − c_ref = K [e; ė/ω], e = c − c_ref, for ∫ position e² + velocity (ė/ω)² + p².

    In time ωt the pendulum is x'' = x − p. Without costs of the state K = (2, 2): p = c_ref +
    2 (ξ − c_ref), which mirrors the unstable pole.
    """
    A = np.array([[0.0, 1.0], [1.0, 0.0]])
    B = np.array([[0.0], [-1.0]])
    X = solve_continuous_are(A, B, np.diag([position, velocity]) + 1e-12 * np.eye(2), np.eye(1))
    return -(B.T @ X)[0]


class LQRLIP(Guided):
    """c̈_des = ω² (c − p), p = c_ref + K [c − c_ref; (ċ − ċ_ref)/ω]."""

    def __init__(self, robot: Robot, config: LQRLIPConfig | None = None):
        self.config = config or LQRLIPConfig()
        super().__init__(robot, self.config.qp)
        self.gain = lqr_gain(self.config.position, self.config.velocity)

    def cop(self, state: RobotState, targets: Targets) -> np.ndarray:
        """(2,) p [m], wherever it lies."""
        error = state.com[:2] - targets.com[:2]
        rate = (state.com_vel[:2] - targets.com_vel[:2]) / state.omega
        return targets.com[:2] + self.gain[0] * error + self.gain[1] * rate
