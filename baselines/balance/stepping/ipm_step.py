"""Steps to where an inverted pendulum comes to rest upright, by its energy."""

import numpy as np

from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.pendulum import pendulum
from poise.envs.robots.robot import Robot

from .capture_step import CaptureStep
from .planning.blocks import Search
from .planning.config import IPMStepConfig
from .planning.search import clip_to_limits, to_step_frame, to_world, with_offsets


@compiled
def rest_distance(speed: float, omega: float, height: float, arc: float) -> float:
    """Return how far ahead of the CoM a foot stops it [m]: the energy left over the foot is 0.

    Linear pendulum, orbital energy E = ½ ẋ² − ½ ω² x² = 0:      x = ẋ/ω
    rigid leg, ½ ẋ² + g z = g √(z² + x²) [Coros10]:              x = ẋ/ω √(1 + ẋ²/(4 g z))

    `arc` leads from the first (0) to the second (1); g = ω² z.
    """
    return speed / omega * np.sqrt(1.0 + arc * (0.5 * speed / (omega * height)) ** 2)


@compiled
def energy_foothold(q: Search) -> None:
    """The foothold over which the pendulum stands still and its cost, see `IPMStep`."""
    s, foot, omega, t = q.state, q.foot, q.state.omega, q.time
    x, vx = pendulum(s.com[0], s.com_vel[0], q.cop[0], omega, t)
    y, vy = pendulum(s.com[1], s.com_vel[1], q.cop[1], omega, t)
    speed = np.sqrt(vx * vx + vy * vy)
    away = rest_distance(speed, omega, q.height, q.arc) / max(speed, 1e-9)
    x, y = to_step_frame(q, x + away * vx, y + away * vy)
    x -= q.region.middle[foot, 0]
    y += q.foot_sign[foot] * q.lateral_offset - q.region.middle[foot, 1]
    x, y = with_offsets(q, x, y)
    near_x, near_y = clip_to_limits(q, x, y, q.width_min)
    q.foothold[0], q.foothold[1] = to_world(q, near_x, near_y)
    q.cost = np.sqrt((near_x - x) ** 2 + (near_y - y) ** 2)


class IPMStep(CaptureStep):
    """`capture-step` with footholds by energy [Notes, lecture 11], the step time given.

    Each is where the pendulum stands still, from where it is at touchdown. Until then the CoP is
    taken to stay at p, where the stance sole brakes most; the cost is how far limits keep the
    foothold from the one desired [m]. Balance with feet fixed, the trigger of a step, the swing,
    and balance on one foot and after are those of `capture-step`. Raises ConfigError unless there
    are two soles.
    """

    foothold_rule = staticmethod(energy_foothold)

    def __init__(self, robot: Robot, config: IPMStepConfig | None = None):
        config = config or IPMStepConfig()
        if not isinstance(config, IPMStepConfig):
            raise TypeError(f"config must be an IPMStepConfig, not {type(config).__name__}")
        self._arc = config.arc
        super().__init__(robot, config)
