"""What the kernels of `StepPlanner`, `CopRegion` and `Swing` find, as values."""

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.stepping.planner import StepPlanner
from poise.baselines.balance.stepping.planning.blocks import Search
from poise.baselines.balance.stepping.planning.cop_region import CopRegion, distance_beyond
from poise.baselines.balance.stepping.planning.search import plan_step, replan_step, set_foot
from poise.baselines.balance.stepping.planning.swing import Swing, advance_over, aim_swing
from poise.envs.compiled.maths.vectors import turn
from poise.envs.physics.state import RobotState


class StepPlan(NamedTuple):
    """A step."""

    foot: int  #: the foot that steps
    foothold: np.ndarray  #: (2,) [m]
    time: float  #: from now to touchdown [s]
    cost: float  #: [m]
    time_offset: float = 0.0  #: part of the time that feedback and a policy added [s]


def plan(planner: StepPlanner, state: RobotState, yaw: float) -> StepPlan:
    """The best step of either foot from where they stand."""
    search = _along(planner, state, yaw)
    plan_step(search)
    return _best(search)


def replan(
    planner: StepPlanner, state: RobotState, foot: int, yaw: float, swing: Swing
) -> StepPlan:
    """The foothold and the time left of a running step."""
    search = _along(planner, state, yaw)
    replan_step(search, foot, swing.arrays)
    return _best(search)


def footholds(
    planner: StepPlanner, state: RobotState, foot: int, yaw: float, times: np.ndarray,
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Footholds (n, 2) of steps of `foot` that land after `times` (n,) [s], and their costs [m]."""
    search = _along(planner, state, yaw)
    set_foot(search, foot)
    search.start[:] = start
    found, costs = np.empty((len(times), 2)), np.empty(len(times))
    for k, time in enumerate(times):
        search.time[0] = time
        planner.foothold_rule(search)
        found[k], costs[k] = search.foothold, search.cost[0]
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
    return np.array([distance_beyond(region.arrays, *a, *b, cos, sin, *x) for a, b, x in rows])


def aim(swing: Swing, foothold: np.ndarray, duration: float | None = None) -> None:
    """Lead to another `foothold` (2,), or at another time, see `aim_swing`."""
    duration = swing.duration if duration is None else duration
    aim_swing(swing.arrays, float(foothold[0]), float(foothold[1]), float(duration))


def advance(swing: Swing, dt: float) -> np.ndarray:
    """(3, 3) Position, velocity and acceleration [m, s] after `dt` more seconds."""
    advance_over(swing.arrays, swing.arrays.apex, dt)
    return swing.reference.copy()


def _along(planner: StepPlanner, state: RobotState, yaw: float) -> Search:
    search = planner.search(state)
    search.heading[:] = np.cos(yaw), np.sin(yaw)
    return search


def _best(search: Search) -> StepPlan:
    x, y, time, cost, offset = search.best.tolist()
    return StepPlan(int(search.best_foot[0]), np.array([x, y]), time, cost, offset)
