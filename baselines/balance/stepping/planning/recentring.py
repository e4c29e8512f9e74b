"""Back to the nominal stance: what a stepping controller does once it has come to rest.

Steps end wherever they caught the fall, one foot ahead or both wide apart, and the next push meets
that stance. So when all is calm the weight is shifted to one foot, and the other one goes back: as
near to its nominal place as it can with ξ between the feet at touchdown. Kernels on a
`CaptureTick`.
"""

import numpy as np

from poise.baselines.balance.references.legs import nominal_feet
from poise.envs.compiled.calls import call
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along
from poise.envs.robots.robot import Robot

from .blocks import (
    CaptureTick,
    Recentring,
    Search,
)
from .config import RecentringConfig
from .search import (
    distance_outside,
    end_capture_point,
    schedule_feedback,
    set_foot,
    set_start,
    to_heading,
    to_step_frame,
    to_world,
)
from .swing import FROZEN, LANDING, Swing, start_swing, time_left
from .units import in_si

# No foot goes back; ξ is shifted to one foot; the other foot swings; it takes up its load.
INACTIVE, SHIFTING, SWINGING, LOADING = range(4)
CANDIDATES = 8  # footholds from the nominal one to the one that a planner would choose, but one
BOUNCE_TIME = 0.06  # [s] after touchdown in which a foot may leave the ground
# a foot has slipped when for a time [s] it is off the ground, or slides faster than a speed [m/s]
SLIP_TIME, SLIP_SPEED = 0.04, 0.25


def recentring_arrays(robot: Robot, config: RecentringConfig) -> Recentring:
    """`config` for one robot."""
    feet = nominal_feet(robot)
    numbers = in_si(
        config, robot.units, "distance", "calm_speed", "calm_time", "capture_offset",
        "counterbalance", "arrival_radius", "shift_time_max", "swing_time", "margin",
        "cop_distance",
    )  # fmt: skip
    return Recentring.allocate(
        **numbers,
        calm_cosine=float(np.cos(np.radians(config.calm_tilt))),
        nominal=(feet[0] - feet[1])[:2].copy(),
    )


@compiled
def stop_recentring(r: Recentring) -> None:
    """Let no foot go back."""
    r.stage, r.homing, r.timer = INACTIVE, 0, 0.0


@compiled
def set_level_frame(axes: np.ndarray, x: float, y: float) -> None:
    """Set the columns of `axes` (3, 3) to those of a level sole that points along (x, y)."""
    yaw = np.arctan2(y, x)
    axes[0, 0] = axes[1, 1] = np.cos(yaw)
    axes[1, 0] = np.sin(yaw)
    axes[0, 1] = -axes[1, 0]


@compiled
def _stance_error(t: CaptureTick) -> float:
    """The distance of the feet from their nominal stance [m]."""
    feet, cos, sin = t.state.sole_point, t.memory.level_frame[0, 0], t.memory.level_frame[1, 0]
    x, y = along(cos, sin, feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1])
    x, y = x - t.recentring.nominal[0], y - t.recentring.nominal[1]
    return np.sqrt(x * x + y * y)


@compiled
def shift_weight(t: CaptureTick) -> None:
    """Begin to bring ξ near one foot, so that the other one, which is further from ξ, can go back.

    From now on the stance foot points ahead. In its frame ξ is brought to its middle, moved
    `capture_offset` towards the other foot's nominal place and `counterbalance` of that foot's way
    against it.
    """
    s, r, feet = t.state, t.recentring, t.state.sole_point
    distances = t.pair
    for i in range(2):
        x, y = s.capture_point[0] - feet[i, 0], s.capture_point[1] - feet[i, 1]
        distances[i] = np.sqrt(x * x + y * y)
    foot = 1 if distances[0] < distances[1] else 0
    r.stage, r.foot, r.timer = SHIFTING, foot, 0.0
    t.memory.recovering = 1
    axes, level = s.sole_axes[1 - foot], t.memory.level_frame
    set_level_frame(level, axes[0, 0], axes[1, 0])
    t.memory.corners = 0
    q, sign = t.search, 1.0 if foot == 0 else -1.0
    q.foot, q.heading[0], q.heading[1] = foot, level[0, 0], level[1, 0]
    x, y = to_step_frame(q, feet[foot, 0], feet[foot, 1])
    nominal_x, nominal_y = sign * r.nominal[0], sign * r.nominal[1]
    scale = r.capture_offset / np.sqrt(nominal_x * nominal_x + nominal_y * nominal_y)
    middle = q.region.middle[1 - foot]
    rest_x = middle[0] + scale * nominal_x + r.counterbalance * (x - nominal_x)
    rest_y = middle[1] + scale * nominal_y + r.counterbalance * (y - nominal_y)
    r.capture_target[0], r.capture_target[1] = to_world(q, rest_x, rest_y)


@compiled
def _is_calm(t: CaptureTick) -> bool:
    """Return whether the CoM is slow and the root upright."""
    s, r, up = t.state, t.recentring, 0.0
    for a in range(3):
        up += s.root_axes[2, a] * t.search.feedback.upright[a]
    speed = np.sqrt(s.com_vel[0] * s.com_vel[0] + s.com_vel[1] * s.com_vel[1])
    return speed < r.calm_speed and up > r.calm_cosine


@compiled
def recentring_step_due(t: CaptureTick) -> bool:
    """Return whether one of two standing feet lifts off now to go back.

    Counts how long the robot has been calm. When that is long enough, begins to shift the weight,
    or ends the recovery where the feet are near their nominal stance.
    """
    s, r = t.state, t.recentring
    if r.distance == 0.0:
        return False
    if r.stage == SHIFTING:
        r.timer += t.gains.period
        x, y = s.capture_point[0] - r.capture_target[0], s.capture_point[1] - r.capture_target[1]
        return np.sqrt(x * x + y * y) < r.arrival_radius or r.timer > r.shift_time_max
    r.timer = r.timer + t.gains.period if _is_calm(t) else 0.0
    if r.timer > r.calm_time:
        if _stance_error(t) > r.distance:
            shift_weight(t)
        else:
            t.memory.recovering = 0  # as at the start: the next push meets a first step
    return False


@compiled
def limit_cop_distance(t: CaptureTick, rest_x: float, rest_y: float, p: np.ndarray) -> None:
    """Keep `p` (≥ 2,) within `cop_distance` of ξ, until ξ has come to rest at (rest_x, rest_y)."""
    r, xi = t.recentring, t.state.capture_point
    x, y = xi[0] - rest_x, xi[1] - rest_y
    if np.sqrt(x * x + y * y) < r.arrival_radius:
        r.stage = INACTIVE
        return
    x, y = p[0] - xi[0], p[1] - xi[1]
    scale = min(1.0, r.cop_distance / max(np.sqrt(x * x + y * y), 1e-9))
    p[0], p[1] = xi[0] + scale * x, xi[1] + scale * y


@compiled
def _find_foothold(q: Search, r: Recentring, time: float) -> None:
    """The foothold nearest to the nominal one from which ξ(T) lies between the feet, into the best
    of the search."""
    foot, stance = q.foot, q.state.sole_point[1 - q.foot]
    sign = 1.0 if foot == 0 else -1.0
    x, y = to_heading(q, sign * r.nominal[0], sign * r.nominal[1])
    nominal_x, nominal_y = stance[0] + x, stance[1] + y
    q.time = time
    call(q.foothold_rule, q)
    capture_x, capture_y = q.foothold[0], q.foothold[1]
    end_x, end_y = end_capture_point(q)
    for k in range(CANDIDATES + 1):
        blend = k / CANDIDATES
        x, y = (
            nominal_x + blend * (capture_x - nominal_x),
            nominal_y + blend * (capture_y - nominal_y),
        )
        q.foothold[0], q.foothold[1] = x, y
        outside = distance_outside(q, end_x, end_y)
        if outside < -r.margin:
            break
    q.best_x, q.best_y, q.best_time = x, y, time
    q.best_cost, q.best_offset = outside, 0.0
    q.best_foot = foot


@compiled
def plan_recentring(q: Search, r: Recentring) -> None:
    """The step of the foot that goes back, into the best of the search."""
    schedule_feedback(q)
    foot = r.foot
    q.feedback.signals.phase = 0.0
    set_foot(q, foot)
    set_start(q, q.state.sole_point[foot, 0], q.state.sole_point[foot, 1])
    _find_foothold(q, r, r.swing_time)
    r.stage, r.homing = SWINGING, 1


@compiled
def replan_recentring(q: Search, r: Recentring, w: Swing) -> bool:
    """The same in its swing; False where ξ can no longer be caught near the nominal stance."""
    q.feedback.signals.phase = w.time / w.duration
    set_foot(q, r.foot)
    set_start(q, w.reference[0, 0], w.reference[0, 1])
    _find_foothold(q, r, max(time_left(w), FROZEN))
    return q.best_cost <= 0.0


@compiled
def slipped_foot(t: CaptureTick) -> int:
    """The foot that should stand, after a step back, but is off the ground or slides; −1: none.

    It bears little at first, and a contact that is planned but not there drives it away.
    """
    s, r = t.state, t.recentring
    for foot in range(2):
        x, y = s.J_v[6 * foot], s.J_v[6 * foot + 1]
        slips = s.contacts[foot] < 0.5 or np.sqrt(x * x + y * y) > SLIP_SPEED
        slips = slips and s.contacts[1 - foot] > 0.5 and t.memory.clock > BOUNCE_TIME
        r.slip_time[foot] = r.slip_time[foot] + t.gains.period if slips else 0.0
        if r.slip_time[foot] > SLIP_TIME:
            return foot
    return -1


@compiled
def lower_foot(t: CaptureTick, foot: int) -> None:
    """Begin the second half of a swing of a foot that slipped, from where and as fast as it is."""
    s, m, w = t.state, t.memory, t.swing
    m.foot, m.swinging, m.load_fraction = foot, 1, 0.0
    t.recentring.stage = INACTIVE
    start_swing(w, s.sole_point[foot], s.sole_point[1 - foot, 2], t.search.time_min)
    for a in range(3):
        w.reference[1, a] = s.J_v[6 * foot + a]
    w.time = max(w.lift, LANDING) * w.duration


@compiled
def end_recentring_swing(r: Recentring) -> None:
    """Let the foot that went back take up its load, at touchdown."""
    r.slip_time[0] = r.slip_time[1] = 0.0
    if r.stage == SWINGING:
        r.stage = LOADING
