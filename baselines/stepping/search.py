"""The compiled part of `StepPlanner`: steps of either foot in several times, and the cheapest."""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import call
from poise.envs.compiled.jit import compiled
from poise.envs.maths.polygons import find_nearest
from poise.envs.physics.kinematics import StateArrays

from .feedback import AHEAD, OUTWARD, FeedbackArrays, feed_back, take_gains
from .feedback import TIME as LONGER
from .offsets import FOOTHOLD, TIME
from .reach import ReachArrays, distance_beyond, reach_of_one
from .swing import FROZEN, SwingArrays, time_left

TIMES = 8  # step times that are weighed against each other
CHANGE = 0.02  # [m/s] price of another step time while the foot swings


@dataclass(frozen=True, eq=False)
class Search(Block):
    """What a search works on: `StepLimits` and `Foothold` in m and s, the step tried, the best."""

    state: StateArrays
    reach: ReachArrays
    shift: np.ndarray  # see `StepShift`
    feedback: FeedbackArrays
    heading: np.ndarray  # (2,) its cosine and sine
    sides: np.ndarray  # (2,)
    height: float
    ahead: float
    behind: float
    width_min: float
    width_max: float
    speed: float
    side_speed: float
    time_min: float
    time_max: float
    overshoot: float
    outward: float
    margin: float
    haste: float  # [m/s]
    arc: float  # of `EnergyPlanner`
    under: np.ndarray  # (k, 2) scratch: what the stance sole reaches
    p: np.ndarray  # (2,) of these the nearest to ξ
    start: np.ndarray  # (2,) where the foot is
    foot: np.ndarray  # (1,) int
    time: np.ndarray  # (1,)
    foothold: np.ndarray  # (2,) of this foot after this time
    left: np.ndarray  # (1,) [m] what it costs, but for the time
    best: np.ndarray  # (5,) foothold, time, cost, change of the time by a policy
    best_foot: np.ndarray  # (1,) int
    law: int  # address of the kernel that finds `foothold` and `left`


@compiled
def take_foot(q: Search, foot: int):
    """Move this foot; the CoP stays where the other sole brakes ξ most."""
    q.foot[0] = foot
    stance = q.state.sole_point[1 - foot]
    feed_back(q.feedback, q.state, stance, q.heading[0], q.heading[1], q.sides[foot])
    n = reach_of_one(q.reach, 1 - foot, stance, q.heading[0], q.heading[1], q.under)
    find_nearest(q.under[:n], q.state.capture_point, q.p)


@compiled
def start_from(q: Search, x: float, y: float):
    """Where the foot is now."""
    q.start[0], q.start[1] = x, y


@compiled
def to_local(q: Search, x: float, y: float):
    """(x, y) from the stance sole, along the heading."""
    stance, cos, sin = q.state.sole_point[1 - q.foot[0]], q.heading[0], q.heading[1]
    x, y = x - stance[0], y - stance[1]
    return cos * x + sin * y, cos * y - sin * x


@compiled
def turned(q: Search, x: float, y: float):
    """(x, y) along the heading, in the world."""
    cos, sin = q.heading[0], q.heading[1]
    return cos * x - sin * y, sin * x + cos * y


@compiled
def put_foothold(q: Search, x: float, y: float):
    """Set `foothold` to (x, y) from the stance sole, along the heading."""
    stance, cos, sin = q.state.sole_point[1 - q.foot[0]], q.heading[0], q.heading[1]
    q.foothold[0], q.foothold[1] = stance[0] + cos * x - sin * y, stance[1] + sin * x + cos * y


@compiled
def moved(q: Search, x: float, y: float):
    """(x, y) from the stance sole, as feedback and a policy want it."""
    added, side = q.feedback.added, q.sides[q.foot[0]]
    x += added[AHEAD] + q.shift[FOOTHOLD]
    return x, y + side * added[OUTWARD] + q.shift[FOOTHOLD + 1]


@compiled
def allowed(q: Search, x: float, y: float):
    """What limits of place and speed leave of (x, y), from the stance sole along the heading."""
    side, start = q.sides[q.foot[0]], to_local(q, q.start[0], q.start[1])
    x = min(max(x, -q.behind), q.ahead)
    y = side * min(max(side * y, q.width_min), q.width_max)
    gap_x, gap_y = x - start[0], y - start[1]
    share_x, share_y = gap_x / (q.speed * q.time[0]), gap_y / (q.side_speed * q.time[0])
    cut = 1.0 - 1.0 / max(np.sqrt(share_x * share_x + share_y * share_y), 1.0)
    return x - gap_x * cut, y - gap_y * cut


@compiled
def drift(q: Search):
    """ξ(T) = p + (ξ − p) e^(ωT)."""
    xi, p = q.state.capture_point, q.p
    grown = np.exp(q.state.omega[0] * q.time[0])
    return p[0] + (xi[0] - p[0]) * grown, p[1] + (xi[1] - p[1]) * grown


@compiled
def left_outside(q: Search, x: float, y: float) -> float:
    """How far (x, y) lies outside the reach of both soles, this foot at its foothold [m]."""
    foot, heading = q.foot[0], q.heading
    first, second = q.foothold, q.state.sole_point[1 - foot]
    if foot == 1:
        first, second = second, first
    return distance_beyond(
        q.reach, first[0], first[1], second[0], second[1], heading[0], heading[1], x, y
    )


@compiled
def capture_law(q: Search):
    """The foothold under ξ(T), see `StepPlanner.footholds`."""
    foot = q.foot[0]
    end_x, end_y = drift(q)
    x, y = to_local(q, end_x, end_y)
    x, y = x - q.reach.middle[foot, 0], y - q.reach.middle[foot, 1]
    x += q.overshoot * np.tanh(x / (0.1 * q.height))
    y += q.sides[foot] * q.outward
    x, y = moved(q, x, y)
    x, y = allowed(q, x, y)
    put_foothold(q, x, y)
    q.left[0] = max(left_outside(q, end_x, end_y), -q.margin)


@compiled
def _try(q: Search, time: float, extra: float):
    """Keep a step of this time if it is cheaper than the best, or the first."""
    q.time[0] = time
    call(q.law, q)
    cost = q.left[0] + q.haste * time + extra
    if q.best_foot[0] < 0 or cost < q.best[3]:
        q.best[0], q.best[1], q.best[2] = q.foothold[0], q.foothold[1], time
        q.best[3], q.best_foot[0] = cost, q.foot[0]


@compiled
def _shift_best(q: Search):
    """The same step, but that it lands earlier or later, as feedback and a policy want."""
    q.best[4] = 0.0
    later = q.feedback.added[LONGER] + q.shift[TIME]
    if later == 0.0:
        return
    q.time[0] = max(q.best[2] + later, FROZEN)
    call(q.law, q)
    q.best[0], q.best[1] = q.foothold[0], q.foothold[1]
    q.best[2], q.best[4] = q.time[0], q.time[0] - q.best[2]


@compiled
def see_fall(q: Search):
    """Feedback is that of where the body falls now."""
    v, cos, sin = q.state.com_vel, q.heading[0], q.heading[1]
    take_gains(q.feedback, cos * v[0] + sin * v[1], cos * v[1] - sin * v[0])


@compiled
def plan_step(q: Search):
    """The cheapest step of either foot from where they stand, into `best` and `best_foot`."""
    see_fall(q)
    q.best_foot[0] = -1
    q.feedback.stage[1] = 0.0
    for foot in range(2):
        take_foot(q, foot)
        start_from(q, q.state.sole_point[foot, 0], q.state.sole_point[foot, 1])
        for k in range(TIMES):
            _try(q, q.time_min + (q.time_max - q.time_min) * k / (TIMES - 1), 0.0)
    foot = q.best_foot[0]
    take_foot(q, foot)
    start_from(q, q.state.sole_point[foot, 0], q.state.sole_point[foot, 1])
    _shift_best(q)


@compiled
def replan_step(q: Search, foot: int, w: SwingArrays):
    """Foothold and time left of the running step `w` of `foot`, into `best`."""
    low = max(q.time_min - w.time[0], FROZEN)
    high = max(q.time_max - w.time[0], low)
    left = max(time_left(w) - w.shift[0], FROZEN)
    carried = 0.5 * min(left, 0.1)  # where its speed carries it anyway
    q.best_foot[0] = -1
    q.feedback.stage[1] = w.time[0] / w.duration[0]
    take_foot(q, foot)
    start_from(
        q,
        w.reference[0, 0] + carried * w.reference[1, 0],
        w.reference[0, 1] + carried * w.reference[1, 1],
    )
    for k in range(TIMES):
        time = low + (high - low) * k / (TIMES - 1)
        _try(q, time, CHANGE * abs(time - left))
    _try(q, left, 0.0)
    _shift_best(q)
