"""CoP by LQR on the linear inverted pendulum [Stephens07], without a support polygon."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.linalg import solve_continuous_are

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .guided import Guided


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
