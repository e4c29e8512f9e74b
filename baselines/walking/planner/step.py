"""A step of a walk: how long and wide it is, its CoP, where and when it lands; a tick on one foot.

The law of the footholds is that of `dcm.py`.
"""

import numpy as np

from poise.baselines.balance.stepping.planning.cop_region import single_support_region
from poise.baselines.balance.stepping.planning.guidance import limit_posture
from poise.baselines.balance.stepping.planning.search import (
    clip_to_limits,
    set_start,
    to_step_frame,
    to_world,
)
from poise.baselines.balance.stepping.planning.swing import (
    FROZEN,
    advance_high,
    advance_over,
    aim_swing,
    time_left,
)
from poise.baselines.balance.stepping.tick import solve_contacts
from poise.baselines.walking.models.reference import share_load
from poise.envs.compiled.calls import run
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import turned

from .arms import swing_arms
from .blocks import Gait, WalkTick
from .command import MOST_STEP_TIME
from .dcm import constant_cop, gait_offset, step_to_offset, touchdown_target, transfer_factor
from .treads import advance_over_edges, apex_of_step, follow_line, footholds_given, settle_on_tread

ROOM = 0.01  # [m] between the soles of a step to the side, in addition to the least width
TIMES = 8  # step times that are weighed against the planned one
LEAST_TIME = 0.06  # [s] for which the CoP on one foot is planned at least


@compiled
def step_time(g: Gait) -> float:
    """T [s]: as commanded, or the gait's own; no shorter than the legs can."""
    wanted = g.asked_step_time if g.asked_step_time > 0.0 else g.step_time
    if g.commanded_step_length > 0.0:
        speed = np.sqrt(g.command[0] * g.command[0] + g.command[1] * g.command[1])
        period = g.commanded_step_length / max(speed, 1e-9)
        wanted = min(period - g.transfer_time, MOST_STEP_TIME)
    return max(wanted, g.time_min)


@compiled
def least_width(t: WalkTick) -> float:
    """The least distance of the feet across the heading [m]; less where a command asks for it."""
    least, wanted = t.walk.search.width_min, t.gait.commanded_width
    return min(least, wanted - ROOM) if wanted > 0.0 else least


@compiled
def step_width(t: WalkTick) -> float:
    """W [m]: wider where steps to the side need it, so that the feet do not meet."""
    g = t.gait
    way = abs(g.velocity[1]) * (step_time(g) + g.transfer_time)
    wanted = g.commanded_width if g.commanded_width > 0.0 else g.width
    return max(wanted, least_width(t) + way + ROOM)


@compiled
def offset_from(t: WalkTick, swinging: int) -> tuple[float, float]:
    """b [m], in the world, where `swinging` is the next foot to swing; a policy moves it."""
    c, g, level = t.walk, t.gait, t.walk.memory.level_frame
    outward = t.walk.search.foot_sign[swinging] * step_width(t)
    x, y = gait_offset(
        c.state.omega, step_time(g), g.transfer_time, g.planned[0], g.planned[1], outward
    )
    return turned(level[0, 0], level[1, 0], x + c.offsets.com[0], y + c.offsets.com[1])


@compiled
def put_middle(t: WalkTick, foot: int, out: np.ndarray) -> None:
    """The middle of what a sole reaches, in the world, into `out` (2,) [m]."""
    level, middle = t.walk.memory.level_frame, t.walk.search.region.middle[foot]
    x, y = turned(level[0, 0], level[1, 0], middle[0], middle[1])
    point = t.walk.state.sole_point[foot]
    out[0], out[1] = point[0] + x, point[1] + y


@compiled
def ask_for(t: WalkTick, ground: float, stride_x: float, stride_y: float, p: np.ndarray) -> None:
    """The targets of a tick with the CoP at `p` (≥ 2,): c̈ = ω² (c − p), and the height that the
    legs reach over the `ground` with the feet a stride (x, y) apart [m]."""
    c, s, own, offsets = t.walk, t.walk.state, t.walk.reference_out, t.walk.offsets
    half, length = 0.25 * (stride_x * stride_x + stride_y * stride_y), c.gains.leg_length
    height = min(t.gait.height, np.sqrt(max(length * length - half, 0.0)))
    cos, sin = c.memory.level_frame[0, 0], c.memory.level_frame[1, 0]
    dx, dy = turned(cos, sin, offsets.cop[0], offsets.cop[1])
    rate = s.omega * s.omega
    own.cop[0], own.cop[1] = p[0] + dx, p[1] + dy
    for a in range(2):
        own.com[a], own.com_vel[a] = s.com[a], s.com_vel[a]
        own.com_acc[a] = rate * (s.com[a] - own.cop[a])
    own.com[2] = ground + height + offsets.height
    own.com_vel[2] = own.com_acc[2] = 0.0
    if footholds_given(t):
        follow_line(t, height + offsets.height)
    elif not t.constant_height:
        follow_model(t)
    limit_posture(c)
    swing_arms(t, step_time(t.gait) + t.gait.transfer_time)


@compiled
def follow_model(t: WalkTick) -> None:
    """Let the height be what the reference model answers."""
    c, r, s, own, g = t.walk, t.reference, t.walk.state, t.walk.reference_out, t.gait
    new, level = c.memory.foot, c.memory.level_frame
    if c.memory.swinging:
        share_load(r, 1 - new, 1.0, np.inf)
        r.time_left = time_left(c.swing)
        r.landing[0], r.landing[1] = c.swing.foothold[0], c.swing.foothold[1]
    else:
        duration = np.inf if g.starting else g.transfer_time
        share_load(r, new, 0.5 if g.starting else g.clock / duration, duration)
        r.time_left = max(g.transfer_time - g.clock, 0.0)
    r.ahead[0], r.ahead[1] = level[0, 0], level[1, 0]
    for a in range(2):
        r.com_vel[a], r.com_acc[a], r.cop[a] = s.com_vel[a], own.com_acc[a], own.cop[a]
    run(t.model)
    r.begun = 1
    own.com[2] = s.com[2] + r.height[0] + c.offsets.height
    own.com_vel[2], own.com_acc[2] = r.height[1], r.height[2]


@compiled
def plan_cop(t: WalkTick) -> None:
    """The CoP of the stance sole that brings ξ to the end of a regular step, into `gait.cop`."""
    c, g, omega = t.walk, t.gait, t.walk.state.omega
    foot, level, xi = c.memory.foot, c.memory.level_frame, c.state.capture_point
    stance = c.state.sole_point[1 - foot]
    n = single_support_region(
        t.walk.search.region, 1 - foot, stance, level[0, 0], level[1, 0], c.corners
    )
    put_middle(t, 1 - foot, t.stance)
    period, outward = step_time(g) + g.transfer_time, t.walk.search.foot_sign[foot] * step_width(t)
    step = turned(level[0, 0], level[1, 0], period * g.planned[0], outward + period * g.planned[1])
    offset = offset_from(t, 1 - foot)
    factor = transfer_factor(omega, g.transfer_time)
    left = max(time_left(c.swing), LEAST_TIME)
    for a in range(2):
        end = t.stance[a] + touchdown_target(step[a], offset[a], factor, omega, g.transfer_time)
        c.vector[a] = constant_cop(xi[a], end, omega, left)
    find_nearest(c.corners[:n], c.vector, g.cop)
    dx, dy = c.vector[0] - g.cop[0], c.vector[1] - g.cop[1]
    g.miss = np.sqrt(dx * dx + dy * dy) * np.expm1(omega * left)


@compiled
def foothold_after(t: WalkTick, time: float) -> float:
    """The foothold for a touchdown after `time` [s], into `search.foothold`; how far limits keep it
    from the one desired [m]."""
    c, g, q, omega = t.walk, t.gait, t.walk.search, t.walk.state.omega
    foot, xi = c.memory.foot, c.state.capture_point
    factor, growth = transfer_factor(omega, g.transfer_time), np.exp(omega * time)
    offset = offset_from(t, 1 - foot)
    for a in range(2):
        end = g.cop[a] + (xi[a] - g.cop[a]) * growth - t.stance[a]
        way = step_to_offset(end, offset[a], factor, omega, g.transfer_time)
        c.pair[a] = t.stance[a] + way - t.swinging[a]
    q.time = time
    x, y = to_step_frame(q, c.pair[0], c.pair[1])
    x, y = x + c.offsets.foothold[0], y + c.offsets.foothold[1]
    near_x, near_y = clip_to_limits(q, x, y, least_width(t))
    q.foothold[0], q.foothold[1] = to_world(q, near_x, near_y)
    return np.sqrt((near_x - x) ** 2 + (near_y - y) ** 2)


@compiled
def plan_foothold(t: WalkTick) -> None:
    """Lead the swing to the foothold and the time that cost least."""
    c, g, q, w = t.walk, t.gait, t.walk.search, t.walk.swing
    foot, planned = c.memory.foot, time_left(c.swing)
    q.foot = foot
    put_middle(t, foot, t.swinging)
    for a in range(2):
        t.swinging[a] -= c.state.sole_point[foot, a]
    coasting = 0.5 * min(planned, 0.1)  # [s] in which its speed carries the foot anyway
    set_start(
        q,
        w.reference[0, 0] + coasting * w.reference[1, 0],
        w.reference[0, 1] + coasting * w.reference[1, 1],
    )
    low = max(q.time_min - w.time, FROZEN)
    high = max(max(q.time_max, step_time(g)) - w.time, low)  # a command may ask for more
    best, best_x, best_y, best_time = np.inf, 0.0, 0.0, planned
    ground = w.ground
    for k in range(TIMES + 1):
        time = planned if k == 0 else low + (high - low) * (k - 1) / (TIMES - 1)
        regular = step_time(g) + c.offsets.time
        cost = foothold_after(t, time) + g.time_price * abs(w.time + time - regular)
        if footholds_given(t):
            cost += settle_on_tread(t, foot)
        if cost < best:
            best, best_time = cost, time
            best_x, best_y = q.foothold[0], q.foothold[1]
            if footholds_given(t):
                ground = g.treads.target
    aim_swing(w, best_x, best_y, w.time + best_time)
    w.ground = ground


@compiled
def swing_tick(t: WalkTick) -> bool:
    """A tick on one foot; False instead of torques where ξ misses its place at touchdown by so much
    that the walk is given up."""
    c, g, w = t.walk, t.gait, t.walk.swing
    foot = c.memory.foot
    plan_cop(t)
    if g.catch > 0.0 and g.miss > g.catch:
        return False
    if time_left(w) > FROZEN:
        plan_foothold(t)
    stance = c.state.sole_point[1 - foot]
    ask_for(t, stance[2], w.foothold[0] - stance[0], w.foothold[1] - stance[1], g.cop)
    if footholds_given(t):
        advance_over_edges(t)
    elif g.lower > 0.0:
        top = max(w.ground, g.treads.left[2]) + apex_of_step(t)
        advance_high(w, top, g.lower, c.gains.period)
    else:
        advance_over(w, apex_of_step(t), c.gains.period)
    contacts = c.on_second if foot == 0 else c.on_first
    contacts.limited = 0
    solve_contacts(c, contacts)
    return True
