"""CoP from the instantaneous capture point, kept in the support polygon [Englsberger11]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.envs.compiled.maths.polygons import nearest_inside, shrunk
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .guided import Guided


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
