"""The planner of a step: of either foot in several times the cheapest that stops the fall."""

from collections.abc import Callable

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.balance.references.targets import Offsets
from poise.envs.compiled.calls import NO_KERNEL, address_of, call
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.pendulum import drifted_point
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import along, placed
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .blocks import SEARCHED, Search
from .config import FootholdChoice, StepLimits
from .cop_region import CopRegion, distance_beyond, single_support_region
from .feedback import (
    FeedbackArrays,
    evaluate_feedback,
    pivot_offset,
    schedule_gains,
)
from .swing import FROZEN, Swing, time_left
from .units import in_si

TIMES = 8  # step times that are weighed against each other
CHANGE_PRICE = 0.02  # [m/s] of another step time while the foot swings


@compiled
def set_capture_point(q: Search) -> None:
    """Set the capture point that steps and CoP follow: ξ + r, see `PivotConfig`."""
    x, y = pivot_offset(q.feedback, q.state, q.feedback.plan, q.heading[0], q.heading[1])
    q.capture_point[0] = q.state.capture_point[0] + x
    q.capture_point[1] = q.state.capture_point[1] + y


@compiled
def set_foot(q: Search, foot: int) -> None:
    """Search for steps of this foot: set the CoP where the other sole brakes ξ most, and Δ."""
    q.foot = foot
    stance, cos, sin = q.state.sole_point[1 - foot], q.heading[0], q.heading[1]
    evaluate_feedback(q.feedback, q.state, stance, cos, sin, q.foot_sign[foot])
    n = single_support_region(q.region, 1 - foot, stance, cos, sin, q.corners)
    set_capture_point(q)
    find_nearest(q.corners[:n], q.capture_point, q.cop)


@compiled
def set_start(q: Search, x: float, y: float) -> None:
    """Set where the foot is, in the world [m]."""
    q.start[0], q.start[1] = x, y


@compiled
def to_step_frame(q: Search, x: float, y: float) -> tuple[float, float]:
    """The point (x, y) of the world in the frame of the step [m]."""
    stance = q.state.sole_point[1 - q.foot]
    return along(q.heading[0], q.heading[1], x - stance[0], y - stance[1])


@compiled
def to_world(q: Search, x: float, y: float) -> tuple[float, float]:
    """The point (x, y) of the frame of the step, in the world [m]."""
    stance = q.state.sole_point[1 - q.foot]
    return placed(stance[0], stance[1], q.heading[0], q.heading[1], x, y)


@compiled
def to_heading(q: Search, x: float, y: float) -> tuple[float, float]:
    """The vector (x, y) along the heading of the step, in the world."""
    cos, sin = q.heading[0], q.heading[1]
    return cos * x - sin * y, sin * x + cos * y


@compiled
def with_offsets(q: Search, x: float, y: float) -> tuple[float, float]:
    """A foothold (x, y) in the frame of the step, moved by feedback and by a policy [m]."""
    added, side = q.feedback.added, q.foot_sign[q.foot]
    x += added.ahead + q.offsets.foothold[0]
    return x, y + side * added.outward + q.offsets.foothold[1]


@compiled
def clip_to_limits(q: Search, x: float, y: float, least: float) -> tuple[float, float]:
    """Return the foothold (x, y) [m], in the frame of the step, within limits of place and speed.

    The place is limited to a box, with the feet `least` apart [m] or more across the heading. The
    mean velocities vx and vy of the swing are limited to the ellipse (vx/`speed`)² +
    (vy/`side_speed`)² ≤ 1: the way from the start is shortened to it.
    """
    side, start = q.foot_sign[q.foot], to_step_frame(q, q.start[0], q.start[1])
    x = min(max(x, -q.behind), q.ahead)
    y = side * min(max(side * y, least), q.width_max)
    way_x, way_y = x - start[0], y - start[1]
    pace_x, pace_y = way_x / (q.speed * q.time), way_y / (q.side_speed * q.time)
    cut = 1.0 - 1.0 / max(np.sqrt(pace_x * pace_x + pace_y * pace_y), 1.0)
    return x - way_x * cut, y - way_y * cut


@compiled
def end_capture_point(q: Search) -> tuple[float, float]:
    """ξ(T) = p + (ξ − p) e^(ωT): the capture point at touchdown [m]."""
    return drifted_point(q.capture_point, q.cop, q.state.omega, q.time)


@compiled
def distance_outside(q: Search, x: float, y: float) -> float:
    """Return how far (x, y) lies outside the CoP region of both soles, one at its foothold [m]."""
    foot, heading = q.foot, q.heading
    first, second = q.foothold, q.state.sole_point[1 - foot]
    if foot == 1:
        first, second = second, first
    return distance_beyond(
        q.region, first[0], first[1], second[0], second[1], heading[0], heading[1], x, y
    )


@compiled
def capture_foothold(q: Search) -> None:
    """The foothold under ξ(T); its cost is how far ξ(T) is outside the CoP region of both soles
    [m], no less than −margin.

    The CoP is taken to stay at p, where the stance sole brakes ξ most, so that ξ drifts to
    p + (ξ − p) e^(ωT) [Koolen12]; the foothold is what limits of place and speed allow of the one
    desired there.
    """
    foot = q.foot
    end_x, end_y = end_capture_point(q)
    x, y = to_step_frame(q, end_x, end_y)
    x, y = x - q.region.middle[foot, 0], y - q.region.middle[foot, 1]
    x += q.sagittal_offset * np.tanh(x / (0.1 * q.height))
    y += q.foot_sign[foot] * q.lateral_offset
    x, y = with_offsets(q, x, y)
    x, y = clip_to_limits(q, x, y, q.width_min)
    q.foothold[0], q.foothold[1] = to_world(q, x, y)
    q.cost = max(distance_outside(q, end_x, end_y), -q.margin)


@compiled
def _weigh(q: Search, time: float, extra: float) -> None:
    """Keep a step of this time if it is cheaper than the best one, or the first."""
    q.time = time
    call(q.foothold_rule, q)
    cost = q.cost + q.time_price * time + extra
    if q.best_foot < 0 or cost < q.best_cost:
        q.best_x, q.best_y, q.best_time = q.foothold[0], q.foothold[1], time
        q.best_cost, q.best_foot = cost, q.foot


@compiled
def _offset_time(q: Search) -> None:
    """Let the best step land earlier or later, as feedback and a policy want."""
    q.best_offset = 0.0
    offset = q.feedback.added.time + q.offsets.time
    if offset == 0.0:
        return
    q.time = max(q.best_time + offset, FROZEN)
    call(q.foothold_rule, q)
    q.best_x, q.best_y = q.foothold[0], q.foothold[1]
    q.best_time, q.best_offset = q.time, q.time - q.best_time


@compiled
def schedule_feedback(q: Search) -> None:
    """Set the gains of feedback to those of where the body falls now."""
    v = q.state.com_vel
    ahead, left = along(q.heading[0], q.heading[1], v[0], v[1])
    schedule_gains(q.feedback, ahead, left)


@compiled
def plan_step(q: Search) -> None:
    """The cheapest step of either foot from where they stand: the best of the search."""
    schedule_feedback(q)
    q.best_foot = -1
    q.feedback.signals.phase = 0.0
    for foot in range(2):
        set_foot(q, foot)
        set_start(q, q.state.sole_point[foot, 0], q.state.sole_point[foot, 1])
        for k in range(TIMES):
            _weigh(q, q.time_min + (q.time_max - q.time_min) * k / (TIMES - 1), 0.0)
    foot = q.best_foot
    set_foot(q, foot)
    set_start(q, q.state.sole_point[foot, 0], q.state.sole_point[foot, 1])
    _offset_time(q)


@compiled
def replan_step(q: Search, foot: int, w: Swing) -> None:
    """Foothold and time left of the running step `w` of `foot`: the best of the search."""
    low = max(q.time_min - w.time, FROZEN)
    high = max(q.time_max - w.time, low)
    planned = max(time_left(w) - w.time_offset, FROZEN)
    coasting = 0.5 * min(planned, 0.1)  # [s] in which its speed carries the foot anyway
    q.best_foot = -1
    q.feedback.signals.phase = w.time / w.duration
    set_foot(q, foot)
    set_start(
        q,
        w.reference[0, 0] + coasting * w.reference[1, 0],
        w.reference[0, 1] + coasting * w.reference[1, 1],
    )
    for k in range(TIMES):
        time = low + (high - low) * k / (TIMES - 1)
        _weigh(q, time, CHANGE_PRICE * abs(time - planned))
    _weigh(q, planned, 0.0)
    _offset_time(q)


def make_search(
    robot: Robot,
    state: StateArrays,
    region: CopRegion,
    limits: StepLimits,
    choice: FootholdChoice,
    feedback: FeedbackArrays,
    offsets: Offsets,
    rule: Callable[[Search], None] = capture_foothold,
    arc: float = 0.0,
) -> Search:
    """The search for steps of a robot from a state; `rule` finds the foothold of a foot and time.

    `arc` is that of `IPMStepConfig`.
    """
    search = Search.allocate(
        {"k": region.alone.shape[1]}, state=state, region=region, offsets=offsets,
        feedback=feedback, foot_sign=foot_signs(robot), height=robot.units.height,
        **in_si(limits, robot.units, *SEARCHED),
        **in_si(
            choice, robot.units, "sagittal_offset", "lateral_offset", "margin", "time_price"
        ),
        arc=float(arc), foothold_rule=NO_KERNEL,
    )  # fmt: skip
    return search.replace(foothold_rule=address_of(rule, search))
