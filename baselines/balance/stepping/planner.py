"""The planner of a step: foot, foothold and time from which the fall can be stopped."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.envs.compiled.calls import NO_KERNEL, address_of
from poise.envs.compiled.copies import Copyable
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .controller import StepOffsets
from .planning.blocks import Search, zeros
from .planning.config import (
    FallFeedback,
    FootholdChoice,
    PivotConfig,
    StepFeedback,
    StepLimits,
)
from .planning.cop_region import CopRegion
from .planning.feedback import feedback_arrays
from .planning.search import capture_foothold
from .planning.units import in_si


class StepPlanner(Copyable):
    """Weighs steps of both feet, of several durations, by what of the fall they leave.

    A subclass may have another `foothold_rule`. Limits and choice count as they are at the first
    search.
    """

    #: finds the foothold of a foot and time
    foothold_rule: Callable[[Search], None] = staticmethod(capture_foothold)

    def __init__(
        self,
        robot: Robot,
        region: CopRegion,
        limits: StepLimits,
        choice: FootholdChoice,
        feedback: StepFeedback | None = None,
        falls: Mapping[str, FallFeedback] | None = None,
        pivot: PivotConfig | None = None,
        arc: float = 0.0,
    ):
        self.region, self.limits, self.choice, self.arc = region, limits, choice, arc
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
            region = self.region.arrays
            search = Search(
                state=state.arrays,
                region=region,
                offsets=self.offsets.values,
                feedback=self.feedback,
                foot_sign=self.foot_sign,
                height=self.units.height,
                **in_si(Search, self.limits, self.units),
                **in_si(Search, self.choice, self.units),
                arc=float(self.arc),
                **zeros(heading=2, capture_point=2, cop=2, start=2, time=1, foothold=2, cost=1),
                **zeros(corners=region.alone.shape[1:], best=5),
                **zeros(np.int64, foot=1, best_foot=1),
                foothold_rule=NO_KERNEL,
            )
            rule = address_of(self.foothold_rule, search)
            self._search = replace(search, foothold_rule=rule)
        return self._search
