"""Steps to where an inverted pendulum comes to rest upright, by its energy."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .capturability import Reach, turn
from .capture_step import CaptureStep, CaptureStepConfig
from .step_plan import StepPlanner
from .support import nearest_inside


@dataclass(frozen=True)
class IPMStepConfig(CaptureStepConfig):
    """As `capture-step`, but of `foothold` only `outward` counts; `time_min` = `time_max` = T.

    `arc`: share of the height that a rigid leg gains on its way up; 0 is the linear pendulum.
    """

    kind: Literal["ipm-step"] = "ipm-step"  # type: ignore[assignment]
    arc: float = field(default=1.0, metadata={"min": 0.0, "max": 1.0})


def rest_distance(speed: float, omega: float, height: float, arc: float = 0.0) -> float:
    """How far ahead of the CoM a foot stops it [m]: the energy left over the foot is 0.

    Linear pendulum, orbital energy E = ½ ẋ² − ½ ω² x² = 0:      x = ẋ/ω
    rigid leg, ½ ẋ² + g z = g √(z² + x²) [Coros10]:              x = ẋ/ω √(1 + ẋ²/(4 g z))

    `arc` leads from the first (0) to the second (1); g = ω² z.
    """
    return speed / omega * float(np.sqrt(1.0 + arc * (0.5 * speed / (omega * height)) ** 2))


def pendulum(
    c: np.ndarray, velocity: np.ndarray, p: np.ndarray, omega: float, t: float
) -> tuple[np.ndarray, np.ndarray]:
    """(2,) position and velocity after `t` of c̈ = ω² (c − p), p at rest."""
    cosh, sinh = np.cosh(omega * t), np.sinh(omega * t)
    away = c - p
    return p + away * cosh + velocity / omega * sinh, away * omega * sinh + velocity * cosh


class EnergyPlanner(StepPlanner):
    """The foothold over which the pendulum stands still, from where it is at touchdown."""

    arc = 0.0

    def footholds(
        self, state: RobotState, foot: int, yaw: float, times: np.ndarray, start: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Footholds (n, 2) of steps of `foot` that land after `times` (n,) [s], and how far limits
        keep each from the one wanted [m].

        Until touchdown the CoP is taken to stay at p, where the stance sole brakes most.
        """
        R, stance = turn(yaw), state.sole_points[1 - foot, :2]
        p = nearest_inside(self.reach.under(1 - foot, stance, yaw), state.capture_point)
        wanted = np.empty((len(times), 2))
        for k, t in enumerate(times):
            c, velocity = pendulum(state.com[:2], state.com_vel[:2], p, state.omega, t)
            speed = float(np.linalg.norm(velocity))
            away = rest_distance(speed, state.omega, self.h, self.arc)
            wanted[k] = c + away * velocity / max(speed, 1e-9)
        wanted = (wanted - stance) @ R - self.reach.middle[foot]
        wanted[:, 1] += self.sides[foot] * self.choice.outward * self.h
        shifted = wanted + self.shift.foothold
        local = self.allowed(shifted, (start - stance) @ R, foot, times)
        return stance + local @ R.T, np.linalg.norm(local - shifted, axis=1)


class IPMStep(CaptureStep):
    """`capture-step` with footholds by energy [Notes, lecture 11], the step time given.

    Feet in place, the trigger of a step, the swing, and balance on one foot and after are those
    of `capture-step`. Raises ConfigError unless there are two soles.
    """

    def __init__(self, robot: Robot, config: IPMStepConfig | None = None):
        config = config or IPMStepConfig()
        super().__init__(robot, config)
        reach = Reach(robot, config.share)
        self.planner = EnergyPlanner(robot, reach, config.limits, config.foothold)
        self.planner.arc = config.arc
        self.planner.shift = self.shift
