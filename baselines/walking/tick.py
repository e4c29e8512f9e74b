"""A tick of `Walk`, compiled: `capture_tick` until it is told to walk, then the gait.

`walk_tick` is where to begin. The law of the footholds is that of `dcm.py`.
"""

import numpy as np

from poise.baselines.motions.offsets import (
    COM_X,
    COM_Y,
    COM_Z,
    COP_X,
    COP_Y,
    FOOTHOLD_X,
    FOOTHOLD_Y,
    TIME,
)
from poise.baselines.stepping.cop_region import (
    distance_beyond,
    double_support_region,
    single_support_region,
)
from poise.baselines.stepping.guidance import copy_reference, limit_posture
from poise.baselines.stepping.recentring import set_level_frame, stop_recentring
from poise.baselines.stepping.search import (
    clip_to_width,
    set_start,
    to_step_frame,
    to_world,
)
from poise.baselines.stepping.swing import FROZEN, advance_over, aim_swing, start_swing, time_left
from poise.baselines.stepping.tick import (
    FIRST_LOAD,
    capture_tick,
    has_landed,
    solve_contacts,
)
from poise.baselines.whole_body.tick import ContactTick
from poise.envs.compiled.calls import run
from poise.envs.compiled.jit import compiled
from poise.envs.maths.polygons import find_nearest
from poise.envs.maths.vectors import along, copy_into, turned

from .arms import swing_arms
from .blocks import Gait, WalkTick
from .command import MOST_STEP_TIME, STEP_LENGTH, STEP_TIME, WIDTH
from .dcm import (
    constant_cop,
    gait_offset,
    step_to_offset,
    touchdown_target,
    transfer_factor,
    transfer_point,
)
from .models.reference import share_load
from .treads import (
    advance_over_edges,
    apex_of_step,
    feet_are_level,
    follow_line,
    footholds_given,
    lean_ahead,
    meet_treads,
    settle_on_tread,
)

TIMES = 8  # step times that are weighed against the planned one
LEAST_TIME = 0.06  # [s] for which the CoP on one foot is planned at least
LOADED, UNLOADED = 1.5, 1.15  # rates at which the load may go to a foot, and must leave one [1/T_d]
LEAST_LOAD = 0.03  # [m g] that a foot may bear until it leaves
ROOM = 0.01  # [m] between the soles of a step to the side, besides the least width


@compiled
def is_commanded(g: Gait) -> bool:
    """Return whether a velocity is asked for."""
    c = g.command
    speed = np.sqrt(c[0] * c[0] + c[1] * c[1])
    return speed > g.speed_margin or abs(c[2]) * g.width > g.speed_margin


@compiled
def go_on_from(contacts: ContactTick, torques: np.ndarray) -> None:
    """Let the next tick change these `torques` (nv−6,) of the last one no more than it may."""
    copy_into(torques, contacts.applied)
    copy_into(torques, contacts.memory.torques)
    contacts.follows[0] = 1


@compiled
def step_time(g: Gait) -> float:
    """T [s]: as commanded, or the gait's own; no shorter than the legs can."""
    wanted = g.command[STEP_TIME] if g.command[STEP_TIME] > 0.0 else g.step_time
    if g.command[STEP_LENGTH] > 0.0:
        speed = np.sqrt(g.command[0] * g.command[0] + g.command[1] * g.command[1])
        period = g.command[STEP_LENGTH] / max(speed, 1e-9)
        wanted = min(period - g.transfer_time, MOST_STEP_TIME)
    return max(wanted, g.time_min)


@compiled
def start_walking(t: WalkTick) -> None:
    """Begin to shift the weight to the foot that is not to swing first."""
    c, g, m = t.walk, t.gait, t.walk.memory
    before = c.standing.problem.workspace.tau if m.steps[0] == 0 else t.capture.on_both.applied
    go_on_from(c.on_both, before)
    if m.recovering[0] == 0:
        g.yaw[0] = np.arctan2(c.state.heading[1], c.state.heading[0])
    else:
        g.yaw[0] = np.arctan2(m.level_frame[1, 0], m.level_frame[0, 0])
    stop_recentring(c.recentring)
    first = 0 if g.command[1] * t.walk.search.foot_sign[0] > 0.0 else 1
    m.foot[0], m.recovering[0], m.corners[0] = 1 - first, 1, 0
    g.walking[0], g.starting[0], g.clock[0], g.step_clock[0] = 1, 1, 0.0, -1.0
    for a in range(3):
        g.velocity[a] = 0.0
    g.error[0] = g.error[1] = 0.0
    t.reference.begun[0] = 0


@compiled
def follow_command(t: WalkTick) -> None:
    """Let velocity and heading follow the command."""
    g, dt = t.gait, t.walk.gains.period
    for a in range(3):
        most = dt * (g.turn_acceleration if a == 2 else g.acceleration)
        g.velocity[a] += min(max(g.command[a] - g.velocity[a], -most), most)
    for a in range(2):
        g.planned[a] = g.velocity[a] + g.error[a]
    if footholds_given(t):
        meet_treads(t, step_time(g) + g.transfer_time)
    g.yaw[0] += dt * g.velocity[2]
    cos, sin, level = np.cos(g.yaw[0]), np.sin(g.yaw[0]), t.walk.memory.level_frame
    set_level_frame(level, cos, sin)
    q = t.walk.search
    q.heading[0], q.heading[1] = level[0, 0], level[1, 0]
    if g.step_clock[0] >= 0.0:
        g.step_clock[0] += dt


@compiled
def least_width(t: WalkTick) -> float:
    """The least distance of the feet across the heading [m]; less where a command asks for it."""
    least, wanted = t.walk.search.width_min, t.gait.command[WIDTH]
    return min(least, wanted - ROOM) if wanted > 0.0 else least


@compiled
def step_width(t: WalkTick) -> float:
    """W [m]: wider where steps to the side need it, so that the feet do not meet."""
    g = t.gait
    way = abs(g.velocity[1]) * (step_time(g) + g.transfer_time)
    wanted = g.command[WIDTH] if g.command[WIDTH] > 0.0 else g.width
    return max(wanted, least_width(t) + way + ROOM)


@compiled
def offset_from(t: WalkTick, swinging: int) -> tuple[float, float]:
    """b [m], in the world, where `swinging` is the next foot to swing; a policy moves it."""
    c, g, level = t.walk, t.gait, t.walk.memory.level_frame
    outward = t.walk.search.foot_sign[swinging] * step_width(t)
    x, y = gait_offset(
        c.state.omega[0], step_time(g), g.transfer_time, g.planned[0], g.planned[1], outward
    )
    return turned(level[0, 0], level[1, 0], x + c.offsets[COM_X], y + c.offsets[COM_Y])


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
    dx, dy = turned(cos, sin, offsets[COP_X], offsets[COP_Y])
    rate = s.omega[0] * s.omega[0]
    own.cop[0], own.cop[1] = p[0] + dx, p[1] + dy
    for a in range(2):
        own.com[a], own.com_vel[a] = s.com[a], s.com_vel[a]
        own.com_acc[a] = rate * (s.com[a] - own.cop[a])
    own.com[2] = ground + height + offsets[COM_Z]
    own.com_vel[2] = own.com_acc[2] = 0.0
    if footholds_given(t):
        follow_line(t, height + offsets[COM_Z])
    elif not t.constant_height:
        follow_model(t)
    limit_posture(c)
    swing_arms(t, step_time(t.gait) + t.gait.transfer_time)


@compiled
def follow_model(t: WalkTick) -> None:
    """Let the height be what the reference model answers."""
    c, r, s, own, g = t.walk, t.reference, t.walk.state, t.walk.reference_out, t.gait
    new, level = c.memory.foot[0], c.memory.level_frame
    if c.memory.swinging[0]:
        share_load(r, 1 - new, 1.0, np.inf)
        r.time_left[0] = time_left(c.swing)
        r.landing[0], r.landing[1] = c.swing.foothold[0], c.swing.foothold[1]
    else:
        duration = np.inf if g.starting[0] else g.transfer_time
        share_load(r, new, 0.5 if g.starting[0] else g.clock[0] / duration, duration)
        r.time_left[0] = max(g.transfer_time - g.clock[0], 0.0)
    r.ahead[0], r.ahead[1] = level[0, 0], level[1, 0]
    for a in range(2):
        r.com_vel[a], r.com_acc[a], r.cop[a] = s.com_vel[a], own.com_acc[a], own.cop[a]
    run(t.model)
    r.begun[0] = 1
    own.com[2] = s.com[2] + r.height[0] + c.offsets[COM_Z]
    own.com_vel[2], own.com_acc[2] = r.height[1], r.height[2]


@compiled
def shift_cop(t: WalkTick, p: np.ndarray) -> bool:
    """The CoP that brings ξ to where the first swing can begin, into `p`; whether it is there."""
    c, g, xi = t.walk, t.gait, t.walk.state.capture_point
    new = c.memory.foot[0]
    put_middle(t, new, t.stance)
    level = c.memory.level_frame
    outward = t.walk.search.foot_sign[1 - new] * step_width(t)
    x, y = gait_offset(c.state.omega[0], step_time(g), g.transfer_time, 0.0, 0.0, outward)
    x, y = turned(level[0, 0], level[1, 0], x, y)
    x, y = xi[0] - t.stance[0] - x, xi[1] - t.stance[1] - y
    p[0], p[1] = xi[0] + c.gains.gain * x, xi[1] + c.gains.gain * y
    return np.sqrt(x * x + y * y) < g.start_radius or g.clock[0] > g.start_time


@compiled
def transfer_cop(t: WalkTick, p: np.ndarray) -> bool:
    """The CoP on its way to the sole that has landed, into `p`; whether it has arrived."""
    c, g, omega = t.walk, t.gait, t.walk.state.omega[0]
    new, xi = c.memory.foot[0], c.state.capture_point
    put_middle(t, new, t.stance)
    offset = offset_from(t, 1 - new)
    fraction = min(g.clock[0] / g.transfer_time, 1.0)
    left = (1.0 - fraction) * g.transfer_time
    for a in range(2):
        goal = t.stance[a]
        speed = (goal - g.cop[a]) / g.transfer_time
        cop = g.cop[a] + fraction * (goal - g.cop[a])
        planned = transfer_point(cop, speed, goal, goal + offset[a], omega, left)
        p[a] = cop + (1.0 + g.transfer_gain) * (xi[a] - planned)
    limit_loads(t, fraction)
    return fraction >= 1.0


@compiled
def limit_loads(t: WalkTick, fraction: float) -> None:
    """Let the load go to the foot that has landed, and leave the other one."""
    c = t.walk
    weight, new = c.robot.mass * c.robot.gravity, c.memory.foot[0]
    c.on_both.load_limits[new] = weight * (FIRST_LOAD + LOADED * fraction)
    c.on_both.load_limits[1 - new] = weight * max(UNLOADED * (1.0 - fraction), LEAST_LOAD)
    c.on_both.limited[0] = 1


@compiled
def transfer_tick(t: WalkTick) -> bool:
    """A tick on both feet; True instead of torques where the next foot lifts off now."""
    c, g, m = t.walk, t.gait, t.walk.memory
    feet, level, p = c.state.sole_point, m.level_frame, c.pair
    m.corners[0] = double_support_region(
        t.walk.search.region, feet, level[0, 0], level[1, 0], c.cloud, m.region
    )
    c.on_both.limited[0] = 0
    ready = shift_cop(t, c.vector) if g.starting[0] else transfer_cop(t, c.vector)
    g.clock[0] += c.gains.period
    if not g.starting[0]:
        m.clock[0] = g.clock[0]
    if ready:
        return True
    find_nearest(m.region[: m.corners[0]], c.vector, p)
    ground = 0.5 * (feet[0, 2] + feet[1, 2])
    ask_for(t, ground, feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1], p)
    solve_contacts(c, c.on_both)
    return False


@compiled
def lift_off(t: WalkTick) -> None:
    """Begin the swing of the foot that did not step last."""
    c, m = t.walk, t.walk.memory
    foot = 1 - m.foot[0]
    m.steps[0] += 1
    m.foot[0], m.swinging[0], m.load_fraction[0], m.corners[0] = foot, 1, 0.0, 0
    t.gait.starting[0] = 0
    point = c.state.sole_point
    start_swing(c.swing, point[foot], point[1 - foot, 2], step_time(t.gait))
    copy_into(point[foot], t.gait.treads.left)


@compiled
def touch_down(t: WalkTick) -> None:
    """End a swing, and sum up how far the velocity of the last step was off."""
    g, m, feet = t.gait, t.walk.memory, t.walk.state.sole_point
    m.swinging[0], m.clock[0], g.clock[0] = 0, 0.0, 0.0
    x, y = 0.5 * (feet[0, 0] + feet[1, 0]), 0.5 * (feet[0, 1] + feet[1, 1])
    if g.step_clock[0] > 0.0:
        level = m.level_frame
        dx, dy = along(level[0, 0], level[1, 0], x - g.middle[0], y - g.middle[1])
        most = g.correction_limit
        for a, way in ((0, dx), (1, dy)):
            error = g.error[a] + g.correction * (g.velocity[a] - way / g.step_clock[0])
            g.error[a] = min(max(error, -most), most)
    g.middle[0], g.middle[1], g.step_clock[0] = x, y, 0.0


@compiled
def plan_cop(t: WalkTick) -> None:
    """The CoP of the stance sole that brings ξ to the end of a regular step, into `gait.cop`."""
    c, g, omega = t.walk, t.gait, t.walk.state.omega[0]
    foot, level, xi = c.memory.foot[0], c.memory.level_frame, c.state.capture_point
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


@compiled
def foothold_after(t: WalkTick, time: float) -> float:
    """The foothold for a touchdown after `time` [s], into `search.foothold`; how far limits keep it
    from the one desired [m]."""
    c, g, q, omega = t.walk, t.gait, t.walk.search, t.walk.state.omega[0]
    foot, xi = c.memory.foot[0], c.state.capture_point
    factor, growth = transfer_factor(omega, g.transfer_time), np.exp(omega * time)
    offset = offset_from(t, 1 - foot)
    for a in range(2):
        end = g.cop[a] + (xi[a] - g.cop[a]) * growth - t.stance[a]
        way = step_to_offset(end, offset[a], factor, omega, g.transfer_time)
        c.pair[a] = t.stance[a] + way - t.swinging[a]
    q.time[0] = time
    x, y = to_step_frame(q, c.pair[0], c.pair[1])
    x, y = x + c.offsets[FOOTHOLD_X], y + c.offsets[FOOTHOLD_Y]
    near_x, near_y = clip_to_width(q, x, y, least_width(t))
    q.foothold[0], q.foothold[1] = to_world(q, near_x, near_y)
    return np.sqrt((near_x - x) ** 2 + (near_y - y) ** 2)


@compiled
def plan_foothold(t: WalkTick) -> None:
    """Lead the swing to the foothold and the time that cost least."""
    c, g, q, w = t.walk, t.gait, t.walk.search, t.walk.swing
    foot, planned = c.memory.foot[0], time_left(c.swing)
    q.foot[0] = foot
    put_middle(t, foot, t.swinging)
    for a in range(2):
        t.swinging[a] -= c.state.sole_point[foot, a]
    coasting = 0.5 * min(planned, 0.1)  # [s] in which its speed carries the foot anyway
    set_start(
        q,
        w.reference[0, 0] + coasting * w.reference[1, 0],
        w.reference[0, 1] + coasting * w.reference[1, 1],
    )
    low = max(q.time_min - w.time[0], FROZEN)
    high = max(q.time_max - w.time[0], low)
    best, best_x, best_y, best_time = np.inf, 0.0, 0.0, planned
    ground = w.ground[0]
    for k in range(TIMES + 1):
        time = planned if k == 0 else low + (high - low) * (k - 1) / (TIMES - 1)
        regular = step_time(g) + c.offsets[TIME]
        cost = foothold_after(t, time) + g.time_price * abs(w.time[0] + time - regular)
        if footholds_given(t):
            cost += settle_on_tread(t, foot)
        if cost < best:
            best, best_time = cost, time
            best_x, best_y = q.foothold[0], q.foothold[1]
            if footholds_given(t):
                ground = g.treads.target[0]
    aim_swing(w, best_x, best_y, w.time[0] + best_time)
    w.ground[0] = ground


@compiled
def swing_tick(t: WalkTick) -> None:
    """A tick on one foot."""
    c, g, w = t.walk, t.gait, t.walk.swing
    foot = c.memory.foot[0]
    plan_cop(t)
    if time_left(w) > FROZEN:
        plan_foothold(t)
    stance = c.state.sole_point[1 - foot]
    ask_for(t, stance[2], w.foothold[0] - stance[0], w.foothold[1] - stance[1], g.cop)
    if footholds_given(t):
        advance_over_edges(t)
    else:
        advance_over(w, apex_of_step(t), c.gains.period)
    contacts = c.on_second if foot == 0 else c.on_first
    contacts.limited[0] = 0
    solve_contacts(c, contacts)


@compiled
def has_stopped(t: WalkTick) -> bool:
    """Return whether the walk is over: nothing is asked for, and ξ is held by both soles."""
    c, g, v = t.walk, t.gait, t.gait.velocity
    if is_commanded(g) or np.sqrt(v[0] * v[0] + v[1] * v[1]) > g.speed_margin:
        return False
    if g.starting[0]:
        return True
    if abs(v[2]) * g.width > g.speed_margin or (footholds_given(t) and not feet_are_level(t)):
        return False
    feet, level, xi = c.state.sole_point, c.memory.level_frame, c.state.capture_point
    outside = distance_beyond(
        t.walk.search.region, feet[0, 0], feet[0, 1], feet[1, 0], feet[1, 1],
        level[0, 0], level[1, 0], xi[0], xi[1],
    )  # fmt: skip
    return outside < 0.0


@compiled
def stop_walking(t: WalkTick) -> None:
    """Hand over to the steps that catch a fall and lead back to the nominal stance."""
    t.gait.walking[0] = 0
    t.walk.memory.clock[0], t.walk.memory.corners[0] = 0.0, 0
    go_on_from(t.capture.on_both, t.walk.on_both.applied)


@compiled
def count_failures(t: WalkTick) -> None:
    """Count the ticks that no QP could solve."""
    c = t.capture
    failures = c.standing.memory.failures[0] + c.on_both.memory.failures[0]
    c.failures[0] = failures + t.walk.on_both.memory.failures[0]


@compiled
def gait_tick(t: WalkTick) -> bool:
    """A tick of the walk; False instead of torques where it is over."""
    m = t.walk.memory
    follow_command(t)
    copy_reference(t.walk)
    if footholds_given(t) and t.gait.treads.lean > 0.0:
        lean_ahead(t)
    if m.swinging[0] and has_landed(t.walk):
        touch_down(t)
    if not m.swinging[0]:
        if has_stopped(t):
            stop_walking(t)
            return False
        if transfer_tick(t):
            lift_off(t)
    if m.swinging[0]:
        swing_tick(t)
    return True


@compiled
def walk_tick(t: WalkTick) -> None:
    """One tick of `Walk`: `tau` holds torques, unless `to_python` says that Python must."""
    g = t.gait
    t.capture.to_python[0] = 0
    if not g.walking[0] and is_commanded(g) and not t.capture.memory.swinging[0]:
        start_walking(t)
    if not g.walking[0] or not gait_tick(t):
        capture_tick(t.capture)
    count_failures(t)
