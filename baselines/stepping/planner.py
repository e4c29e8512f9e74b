"""Which foot steps, where to and how fast: footholds from which the fall can be stopped."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from poise.envs.compiled.calls import address_of
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import apart
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .feedback import FallFeedback, StepFeedback, feedback_arrays
from .offsets import StepShift
from .reach import Reach, sides
from .search import Search, capture_law, plan_step, replan_step, take_foot
from .swing import Swing


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


class StepPlanner(Copyable):
    """Weighs steps of both feet, of several durations, by what of the fall they leave.

    A subclass may have another `law`; limits and choice count as they are at the first search.
    """

    law: Any = staticmethod(capture_law)  #: compiled: finds the foothold of one foot and time
    arc = 0.0

    def __init__(
        self,
        robot: Robot,
        reach: Reach,
        limits: StepLimits,
        choice: Foothold,
        feedback: StepFeedback | None = None,
        falls: Mapping[str, FallFeedback] | None = None,
    ):
        self.reach, self.limits, self.choice = reach, limits, choice
        self.h, self.rate = robot.height_com, robot.omega
        self.sides = sides(robot)
        self.shift = StepShift()  #: what a policy adds
        self.feedback = feedback_arrays(robot, feedback or StepFeedback(), falls or {})
        self._search: Search | None = None

    def search(self, state: RobotState) -> Search:
        """What the kernels of `search.py` work on."""
        if self._search is None or self._search.state is not state.arrays:
            limits, choice, h, rate = self.limits, self.choice, self.h, self.rate
            search = Search(
                state.arrays, self.reach.arrays, self.shift.values, self.feedback, apart(2),
                self.sides, h,
                limits.ahead * h, limits.behind * h, limits.width_min * h, limits.width_max * h,
                limits.speed * h * rate, limits.side_speed * h * rate,
                limits.time_min / rate, limits.time_max / rate,
                choice.overshoot * h, choice.outward * h, choice.margin * h,
                choice.haste * h * rate, float(self.arc),
                apart(self.reach.arrays.alone.shape[1:]), apart(2), apart(2),
                apart(1, dtype=np.int64), apart(1), apart(2), apart(1), apart(5),
                apart(1, dtype=np.int64), 0,
            )  # fmt: skip
            self._search = replace(search, law=address_of(self.law, search))
        return self._search

    def _along(self, state: RobotState, yaw: float) -> Search:
        search = self.search(state)
        search.heading[:] = np.cos(yaw), np.sin(yaw)
        return search

    def plan(self, state: RobotState, yaw: float) -> Plan:
        """The best step of either foot from where they stand."""
        search = self._along(state, yaw)
        plan_step(search)
        return found(search)

    def replan(self, state: RobotState, foot: int, yaw: float, swing: Swing) -> Plan:
        """Foothold and time left of a running step."""
        search = self._along(state, yaw)
        replan_step(search, foot, swing.arrays)
        return found(search)

    def footholds(
        self, state: RobotState, foot: int, yaw: float, times: np.ndarray, start: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Footholds (n, 2) of steps of `foot` that land after `times` (n,) [s], and how far ξ will
        then be outside the reach of both soles [m], no less than −margin.

        The CoP is taken to stay at p, where the stance sole brakes ξ most, so that ξ drifts to
        p + (ξ − p) e^(ωt) [Koolen12]; the foothold is what limits of place and speed allow of the
        one wanted there.
        """
        search = self._along(state, yaw)
        take_foot(search, foot)
        search.start[:] = start
        footholds, left = np.empty((len(times), 2)), np.empty(len(times))
        for k, time in enumerate(times):
            search.time[0] = time
            self.law(search)
            footholds[k], left[k] = search.foothold, search.left[0]
        return footholds, left


def found(search: Search) -> Plan:
    """The best step of a search."""
    x, y, time, cost, shift = search.best.tolist()
    return Plan(int(search.best_foot[0]), np.array([x, y]), time, cost, shift)
