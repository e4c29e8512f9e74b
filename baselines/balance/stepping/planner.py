"""The planner of a step: foot, foothold and time from which the fall can be stopped."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypedDict

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.envs.compiled.calls import NO_KERNEL, address_of
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .controller import StepOffsets
from .planning.blocks import Search
from .planning.config import FallFeedback, FootholdChoice, PivotConfig, StepFeedback, StepLimits
from .planning.cop_region import CopRegion
from .planning.feedback import feedback_arrays
from .planning.search import capture_foothold


class SearchLimits(TypedDict):
    """`StepLimits` in SI units, as a `Search` has them [m, m/s, s]."""

    ahead: float
    behind: float
    width_min: float
    width_max: float
    speed: float
    side_speed: float
    time_min: float
    time_max: float


def search_limits(limits: StepLimits, units: Units) -> SearchLimits:
    """The limits of steps of a robot with these units."""
    h, omega = units.height, units.omega
    return {
        "ahead": limits.ahead * h,
        "behind": limits.behind * h,
        "width_min": limits.width_min * h,
        "width_max": limits.width_max * h,
        "speed": limits.speed * h * omega,
        "side_speed": limits.side_speed * h * omega,
        "time_min": limits.time_min / omega,
        "time_max": limits.time_max / omega,
    }


class StepPlanner(Copyable):
    """Weighs steps of both feet, of several durations, by what of the fall they leave.

    A subclass may have another `foothold_rule`. Limits and choice count as they are at the first
    search.
    """

    #: finds the foothold of a foot and time
    foothold_rule: Callable[[Search], None] = staticmethod(capture_foothold)
    arc = 0.0

    def __init__(
        self,
        robot: Robot,
        region: CopRegion,
        limits: StepLimits,
        choice: FootholdChoice,
        feedback: StepFeedback | None = None,
        falls: Mapping[str, FallFeedback] | None = None,
        pivot: PivotConfig | None = None,
    ):
        self.region, self.limits, self.choice = region, limits, choice
        self.units = robot.units
        self.foot_sign = foot_signs(robot)
        self.offsets = StepOffsets()  #: what a policy adds
        self.feedback = feedback_arrays(
            robot, feedback or StepFeedback(), falls or {}, pivot or PivotConfig()
        )
        self._search: Search | None = None

    def search(self, state: RobotState) -> Search:
        """The block that the kernels of `search.py` work on."""
        if self._search is None or self._search.state is not state.arrays:
            search = self._allocate(state)
            rule = address_of(self.foothold_rule, search)
            self._search = replace(search, foothold_rule=rule)
        return self._search

    def _allocate(self, state: RobotState) -> Search:
        choice, region = self.choice, self.region.arrays
        h, omega = self.units.height, self.units.omega
        return Search(
            state=state.arrays,
            region=region,
            offsets=self.offsets.values,
            feedback=self.feedback,
            heading=guarded_zeros(2),
            foot_sign=self.foot_sign,
            height=h,
            **search_limits(self.limits, self.units),
            sagittal_offset=choice.sagittal_offset * h,
            lateral_offset=choice.lateral_offset * h,
            margin=choice.margin * h,
            time_price=choice.time_price * h * omega,
            arc=float(self.arc),
            capture_point=guarded_zeros(2),
            corners=guarded_zeros(region.alone.shape[1:]),
            cop=guarded_zeros(2),
            start=guarded_zeros(2),
            foot=guarded_zeros(1, dtype=np.int64),
            time=guarded_zeros(1),
            foothold=guarded_zeros(2),
            cost=guarded_zeros(1),
            best=guarded_zeros(5),
            best_foot=guarded_zeros(1, dtype=np.int64),
            foothold_rule=NO_KERNEL,
        )
