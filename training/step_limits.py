"""What steps could recover at best: the N-step limit of a linear inverted pendulum."""

import numpy as np

from poise.baselines.capturability import Reach, capture_distance
from poise.baselines.step_plan import StepLimits
from poise.envs.pushes import duration_factor

from .limits import PushLimits


class NStepLimit:
    """J = m ω d_N · J(T)/J(0), d_N = r + l a (1 − a^N)/(1 − a), a = e^(−ω T_s) [Koolen12].

    In each direction: r is how far the CoP can be brought from the CoM, by both soles with the
    torques of their ankles; l how far a foot gets in one step of the shortest time T_s, by
    `steps`. An upper bound: it knows neither legs that must not cross nor the CoM's height.
    """

    def __init__(self, limits: PushLimits, steps: StepLimits | None = None):
        self.limits, self.steps = limits, steps or StepLimits()
        standing = limits.standing
        region = Reach(limits.robot, 1.0).both(standing.sole_points, standing.heading_yaw)
        self._region = region - standing.com[:2]

    def reach(self, direction: float) -> float:
        """r [m], `direction` in degrees."""
        ray, region = _unit(direction), self._region
        edges = np.roll(region, -1, axis=0) - region
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
        speeds = normals @ ray
        ahead = speeds > 1e-12
        gaps = np.einsum("ij,ij->i", normals, region)
        return float(np.min(gaps[ahead] / speeds[ahead]))

    def length(self, direction: float) -> float:
        """l [m], `direction` in degrees: within the box and the speeds of `steps`."""
        steps, (x, y) = self.steps, np.abs(_unit(direction))
        forward = steps.ahead if np.cos(np.radians(direction)) >= 0.0 else steps.behind
        box = min(forward / max(x, 1e-9), steps.width_max / max(y, 1e-9))
        fast = steps.time_min / np.hypot(x / steps.speed, y / steps.side_speed)
        return float(min(box, fast) * self.limits.robot.height_com)

    def __call__(self, direction: float, duration: float, count: int) -> float:
        """J [N·s] of a square push of `duration` that `count` steps can stop."""
        omega, mass = self.limits.omega, self.limits.robot.mass
        r, length = self.reach(direction), self.length(direction)
        d = capture_distance(count, r, length, omega, self.steps.time_min / omega)
        return mass * omega * d * duration_factor(omega, duration)


def _unit(direction: float) -> np.ndarray:
    angle = np.radians(direction)
    return np.array([np.cos(angle), np.sin(angle)])
