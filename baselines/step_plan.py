"""Which foot steps, where to and how fast: footholds from which the fall can be stopped."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .capturability import Reach, drifted, sides, turn
from .step_shift import StepShift
from .support import nearest_inside
from .swing import Swing

TIMES = 8  # step times that are weighed against each other
CHANGE = 0.02  # [m/s] price of another step time while the foot swings


@dataclass(frozen=True)
class StepLimits:
    """Where a foot may be put, measured from the other one along the heading; in h.

    The least width keeps the legs from crossing and the feet from touching; mean speeds of the
    swing in h ω, times in 1/ω.
    """

    ahead: float = field(default=0.75, metadata={"min": 0.0})
    behind: float = field(default=0.7, metadata={"min": 0.0})
    width_min: float = field(default=0.19, metadata={"above": 0.0})
    width_max: float = field(default=0.75, metadata={"above": 0.0})
    speed: float = field(default=0.7, metadata={"above": 0.0})
    side_speed: float = field(default=0.5, metadata={"above": 0.0})
    time_min: float = field(default=0.9, metadata={"above": 0.0})
    time_max: float = field(default=1.4, metadata={"above": 0.0})

    def __post_init__(self) -> None:
        if self.time_max < self.time_min:
            raise ValueError(f"time_max: must be at least time_min, {self.time_min}")
        if self.width_max < self.width_min:
            raise ValueError(f"width_max: must be at least width_min, {self.width_min}")


@dataclass(frozen=True)
class Foothold:
    """Where a foothold lies from the capture point that it is to stop; lengths in h.

    `overshoot` puts it beyond ξ along the heading, `outward` to the foot's own side, so that ξ
    comes to lie between the feet. `margin`: as far inside both soles' reach is as good as
    anything. `haste`: price of time, in h per 1/ω.
    """

    overshoot: float = 0.04
    outward: float = 0.08
    margin: float = field(default=0.06, metadata={"min": 0.0})
    haste: float = field(default=0.04, metadata={"min": 0.0})


class Plan(NamedTuple):
    """A step: which foot, where to, how long [s], at what cost [m]."""

    foot: int
    foothold: np.ndarray  # (2,)
    time: float
    cost: float
    shift: float = 0.0  # of the time, by a policy [s]


class StepPlanner:
    """Weighs steps of both feet, of several durations, by what of the fall they leave."""

    def __init__(self, robot: Robot, reach: Reach, limits: StepLimits, choice: Foothold):
        self.reach, self.limits, self.choice = reach, limits, choice
        self.h = robot.height_com
        self.rate = float(np.sqrt(-robot.model.opt.gravity[2] / self.h))  # ω
        self.sides = sides(robot)
        self.shift = StepShift()  #: what a policy adds

    def plan(self, state: RobotState, yaw: float) -> Plan:
        """The best step of either foot from where they stand."""
        limits = self.limits
        times = np.linspace(limits.time_min, limits.time_max, TIMES) / self.rate
        plans = [self._best(state, foot, yaw, times) for foot in range(2)]
        return self._shifted(state, yaw, min(plans, key=lambda plan: plan.cost))

    def replan(self, state: RobotState, foot: int, yaw: float, swing: Swing) -> Plan:
        """Foothold and time left of a running step."""
        low = max(self.limits.time_min / self.rate - swing.time, Swing.FROZEN)
        high = max(self.limits.time_max / self.rate - swing.time, low)
        left = max(swing.remaining - swing.shift, Swing.FROZEN)
        times = np.append(np.linspace(low, high, TIMES), left)
        position, velocity = swing.reference[0, :2], swing.reference[1, :2]
        start = position + 0.5 * velocity * min(left, 0.1)  # what its speed carries it anyway
        best = self._best(state, foot, yaw, times, start, CHANGE * np.abs(times - left))
        return self._shifted(state, yaw, best, start)

    def _shifted(
        self, state: RobotState, yaw: float, plan: Plan, start: np.ndarray | None = None
    ) -> Plan:
        """The same step, but that it lands earlier or later, as a policy wants."""
        if self.shift.time == 0.0:
            return plan
        time = max(plan.time + self.shift.time, Swing.FROZEN)
        start = state.sole_points[plan.foot, :2] if start is None else start
        footholds, _ = self.footholds(state, plan.foot, yaw, np.array([time]), start)
        return Plan(plan.foot, footholds[0], time, plan.cost, time - plan.time)

    def _best(
        self,
        state: RobotState,
        foot: int,
        yaw: float,
        times: np.ndarray,
        start: np.ndarray | None = None,
        extra: float | np.ndarray = 0.0,
    ) -> Plan:
        start = state.sole_points[foot, :2] if start is None else start
        footholds, left = self.footholds(state, foot, yaw, times, start)
        cost = left + self.choice.haste * times * self.h * self.rate + extra
        k = int(np.argmin(cost))
        return Plan(foot, footholds[k], float(times[k]), float(cost[k]))

    def footholds(
        self, state: RobotState, foot: int, yaw: float, times: np.ndarray, start: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Footholds (n, 2) of steps of `foot` that land after `times` (n,) [s], and how far ξ will
        then be outside the reach of both soles [m], no less than −margin.

        The CoP is taken to stay at p, where the stance sole brakes ξ most, so that ξ drifts to
        p + (ξ − p) e^(ωt) [Koolen12]; the foothold is what limits of place and speed allow of the
        one wanted there.
        """
        choice, h = self.choice, self.h
        R, side = turn(yaw), self.sides[foot]
        stance = state.sole_points[1 - foot, :2]
        xi = state.capture_point
        p = nearest_inside(self.reach.under(1 - foot, stance, yaw), xi)
        end = drifted(xi, p, state.omega, times[:, None])
        local = (end - stance) @ R - self.reach.middle[foot]
        local[:, 0] += choice.overshoot * h * np.tanh(local[:, 0] / (0.1 * h))
        local[:, 1] += side * choice.outward * h
        local += self.shift.foothold
        local = self.allowed(local, (start - stance) @ R, foot, times)
        footholds = stance + local @ R.T
        first, second = (footholds, stance) if foot == 0 else (stance, footholds)
        outside = self.reach.beyond(first, second, yaw, end)
        return footholds, np.maximum(outside, -choice.margin * h)

    def allowed(
        self, local: np.ndarray, start: np.ndarray, foot: int, times: np.ndarray
    ) -> np.ndarray:
        """(n, 2) what limits of place and speed leave of footholds `local` (n, 2), both from the
        stance foot along the heading, for a foot that is at `start` (2,)."""
        limits, h, side = self.limits, self.h, self.sides[foot]
        local = local.copy()
        local[:, 0] = np.clip(local[:, 0], -limits.behind * h, limits.ahead * h)
        local[:, 1] = side * np.clip(side * local[:, 1], limits.width_min * h, limits.width_max * h)
        gap = local - start
        span = np.array([limits.speed, limits.side_speed]) * h * self.rate * times[:, None]
        excess = np.maximum(np.linalg.norm(gap / span, axis=1), 1.0)
        return local - gap * (1.0 - 1.0 / excess)[:, None]
