"""What the kernels of `Search`, `CopRegion` and `Swing` find, as values."""

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.balance.references.targets import no_offsets
from poise.baselines.balance.stepping.planning.blocks import Search
from poise.baselines.balance.stepping.planning.config import (
    PivotConfig,
    StepFeedback,
)
from poise.baselines.balance.stepping.planning.cop_region import (
    CopRegion,
    cop_region,
    distance_beyond,
)
from poise.baselines.balance.stepping.planning.feedback import feedback_arrays
from poise.baselines.balance.stepping.planning.search import (
    capture_foothold,
    make_search,
    plan_step,
    replan_step,
    set_foot,
)
from poise.baselines.balance.stepping.planning.swing import Swing, advance_over, aim_swing
from poise.envs.compiled.maths.vectors import turn
from poise.envs.physics.state import RobotState


class Planner:
    """What searches for steps are made of, for any state."""

    def __init__(self, robot, limits, choice, feedback=None, falls=None, **rule):
        self.robot, self.limits, self.choice, self.units = robot, limits, choice, robot.units
        self.region, self.offsets = cop_region(robot), no_offsets()
        self.foot_sign = foot_signs(robot)
        self.feedback = feedback_arrays(
            robot, feedback or StepFeedback(), falls or {}, PivotConfig()
        )
        self.foothold_rule, self.further = rule.get("rule", capture_foothold), rule

    @classmethod
    def of(cls, controller):
        """That of a controller, which shares feedback and offsets."""
        made = cls(controller.robot, controller.step_limits, controller.config.foothold)
        made.region, made.offsets = controller.region, controller.offsets
        made.feedback = controller.feedback
        return made

    def search(self, state: RobotState) -> Search:
        """The search for steps from a state."""
        return make_search(
            self.robot, state.arrays, self.region, self.limits, self.choice, self.feedback,
            self.offsets, **self.further,
        )  # fmt: skip


class StepPlan(NamedTuple):
    """A step."""

    foot: int  #: the foot that steps
    foothold: np.ndarray  #: (2,) [m]
    time: float  #: from now to touchdown [s]
    cost: float  #: [m]
    time_offset: float = 0.0  #: part of the time that feedback and a policy added [s]


def plan(planner: Planner, state: RobotState, yaw: float) -> StepPlan:
    """The best step of either foot from where they stand."""
    search = _along(planner, state, yaw)
    plan_step(search)
    return _best(search)


def replan(planner: Planner, state: RobotState, foot: int, yaw: float, swing: Swing) -> StepPlan:
    """The foothold and the time left of a running step."""
    search = _along(planner, state, yaw)
    replan_step(search, foot, swing)
    return _best(search)


def footholds(
    planner: Planner, state: RobotState, foot: int, yaw: float, times: np.ndarray,
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Footholds (n, 2) of steps of `foot` that land after `times` (n,) [s], and their costs [m]."""
    search = _along(planner, state, yaw)
    set_foot(search, foot)
    search.start[:] = start
    found, costs = np.empty((len(times), 2)), np.empty(len(times))
    for k, time in enumerate(times):
        search.time = time
        planner.foothold_rule(search)
        found[k], costs[k] = search.foothold, search.cost
    return found, costs


def alone(region: CopRegion, sole: int, point: np.ndarray, yaw: float) -> np.ndarray:
    """(k, 2) The region of a sole alone at `point` (≥ 2,), turned by `yaw` [m]."""
    return point[:2] + region.alone[sole] @ turn(yaw).T


def beyond(
    region: CopRegion, first: np.ndarray, second: np.ndarray, yaw: float, xi: np.ndarray
) -> np.ndarray:
    """(n,) How far points `xi` (n, 2) lie outside the region of both soles [m]; < 0 inside.

    The soles are at `first` and `second`, (n, 2) or (2,).
    """
    rows = zip(*np.atleast_2d(*np.broadcast_arrays(first, second, xi)), strict=True)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([distance_beyond(region, *a, *b, cos, sin, *x) for a, b, x in rows])


def aim(swing: Swing, foothold: np.ndarray, duration: float | None = None) -> None:
    """Lead to another `foothold` (2,), or at another time, see `aim_swing`."""
    duration = swing.duration if duration is None else duration
    aim_swing(swing, float(foothold[0]), float(foothold[1]), float(duration))


def advance(swing: Swing, dt: float) -> np.ndarray:
    """(3, 3) Position, velocity and acceleration [m, s] after `dt` more seconds."""
    advance_over(swing, swing.apex, dt)
    return swing.reference.copy()


def _along(planner: Planner, state: RobotState, yaw: float) -> Search:
    search = planner.search(state)
    search.heading[:] = np.cos(yaw), np.sin(yaw)
    return search


def _best(search: Search) -> StepPlan:
    x, y, time = search.best_x, search.best_y, search.best_time
    cost, offset = search.best_cost, search.best_offset
    return StepPlan(int(search.best_foot), np.array([x, y]), time, cost, offset)
