"""A tick of `Walk`, compiled: `capture_tick` until it is commanded to walk, then the gait.

`walk_tick` is where to begin; the tick on one foot is in `step.py`.
"""

import numpy as np

from poise.baselines.balance.stepping.planning.cop_region import (
    distance_beyond,
    double_support_region,
)
from poise.baselines.balance.stepping.planning.guidance import copy_reference
from poise.baselines.balance.stepping.planning.recentring import set_level_frame, stop_recentring
from poise.baselines.balance.stepping.planning.swing import LANDING, start_swing
from poise.baselines.balance.stepping.tick import (
    FIRST_LOAD,
    capture_tick,
    has_landed,
    solve_contacts,
)
from poise.baselines.whole_body.compensation import watch
from poise.baselines.whole_body.tick import go_on_from
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import along, copy_into, turned
from poise.envs.physics.kinematics import borne_weight

from .planner.blocks import Gait, WalkTick
from .planner.dcm import gait_offset, transfer_point
from .planner.step import ask_for, offset_from, put_middle, step_time, step_width, swing_tick
from .planner.treads import feet_are_level, footholds_given, lean_ahead, meet_treads

LOADED, UNLOADED = 1.5, 1.15  # rates at which the load may go to a foot, and must leave one [1/T_d]
HELD_UP = 0.013  # [h] above where the swing leads it: the ground holds the foot up
FLAT = 0.978  # cosine of 12°, the most that a sole is tilted then
LATE = 0.5  # of a swing, after which another step time counts for the next one
LEAST_LOAD = 0.03  # [m g] that a foot may bear until it leaves


@compiled
def is_commanded(g: Gait) -> bool:
    """Return whether a velocity is asked for."""
    c = g.command
    speed = np.sqrt(c[0] * c[0] + c[1] * c[1])
    return speed > g.speed_margin or abs(c[2]) * g.width > g.speed_margin


@compiled
def start_walking(t: WalkTick) -> None:
    """Begin to shift the weight to the foot that is not to swing first."""
    c, g, m = t.walk, t.gait, t.walk.memory
    before = c.standing.problem.workspace.tau if m.steps == 0 else t.capture.on_both.applied
    go_on_from(c.on_both, before)
    if m.recovering == 0:
        g.yaw = np.arctan2(c.state.heading[1], c.state.heading[0])
    else:
        g.yaw = np.arctan2(m.level_frame[1, 0], m.level_frame[0, 0])
    stop_recentring(c.recentring)
    first = 0 if g.command[1] * t.walk.search.foot_sign[0] > 0.0 else 1
    m.foot, m.recovering, m.corners = 1 - first, 1, 0
    g.walking, g.starting, g.clock, g.step_clock = 1, 1, 0.0, -1.0
    g.caught = 0
    for a in range(3):
        g.velocity[a] = 0.0
    g.error[0] = g.error[1] = 0.0
    t.reference.begun = 0


@compiled
def follow_command(t: WalkTick) -> None:
    """Let velocity and heading follow the command."""
    g, dt = t.gait, t.walk.gains.period
    for a in range(3):
        most = dt * (g.turn_acceleration if a == 2 else g.acceleration)
        g.velocity[a] += min(max(g.command[a] - g.velocity[a], -most), most)
    w = t.walk.swing
    if t.walk.memory.swinging == 0 or w.time < LATE * w.duration:
        g.asked_step_time = g.commanded_step_time
    for a in range(2):
        g.planned[a] = g.velocity[a] + g.error[a]
    if footholds_given(t):
        meet_treads(t, step_time(g) + g.transfer_time)
    g.yaw += dt * g.velocity[2]
    cos, sin, level = np.cos(g.yaw), np.sin(g.yaw), t.walk.memory.level_frame
    set_level_frame(level, cos, sin)
    q = t.walk.search
    q.heading[0], q.heading[1] = level[0, 0], level[1, 0]
    if g.step_clock >= 0.0:
        g.step_clock += dt


@compiled
def shift_cop(t: WalkTick, p: np.ndarray) -> bool:
    """The CoP that brings ξ to where the first swing can begin, into `p`; whether it is there."""
    c, g, xi = t.walk, t.gait, t.walk.state.capture_point
    new = c.memory.foot
    put_middle(t, new, t.stance)
    level = c.memory.level_frame
    outward = t.walk.search.foot_sign[1 - new] * step_width(t)
    x, y = gait_offset(c.state.omega, step_time(g), g.transfer_time, 0.0, 0.0, outward)
    x, y = turned(level[0, 0], level[1, 0], x, y)
    x, y = xi[0] - t.stance[0] - x, xi[1] - t.stance[1] - y
    p[0], p[1] = xi[0] + c.gains.gain * x, xi[1] + c.gains.gain * y
    return np.sqrt(x * x + y * y) < g.start_radius or g.clock > g.start_time


@compiled
def transfer_cop(t: WalkTick, p: np.ndarray) -> bool:
    """The CoP on its way to the sole that has landed, into `p`; whether it has arrived."""
    c, g, omega = t.walk, t.gait, t.walk.state.omega
    new, xi = c.memory.foot, c.state.capture_point
    put_middle(t, new, t.stance)
    offset = offset_from(t, 1 - new)
    fraction = min(g.clock / g.transfer_time, 1.0)
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
    weight, new = borne_weight(c.robot, c.state), c.memory.foot
    c.on_both.load_limits[new] = weight * (FIRST_LOAD + LOADED * fraction)
    c.on_both.load_limits[1 - new] = weight * max(UNLOADED * (1.0 - fraction), LEAST_LOAD)
    c.on_both.limited = 1


@compiled
def transfer_tick(t: WalkTick) -> bool:
    """A tick on both feet; True instead of torques where the next foot lifts off now."""
    c, g, m = t.walk, t.gait, t.walk.memory
    feet, level, p = c.state.sole_point, m.level_frame, c.pair
    m.corners = double_support_region(
        t.walk.search.region, feet, level[0, 0], level[1, 0], c.cloud, m.region
    )
    c.on_both.limited = 0
    ready = shift_cop(t, c.vector) if g.starting else transfer_cop(t, c.vector)
    g.clock += c.gains.period
    if not g.starting:
        m.clock = g.clock
    if ready:
        return True
    find_nearest(m.region[: m.corners], c.vector, p)
    ground = 0.5 * (feet[0, 2] + feet[1, 2])
    ask_for(t, ground, feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1], p)
    solve_contacts(c, c.on_both)
    return False


@compiled
def stands_higher(t: WalkTick) -> bool:
    """Return whether the foot stands on ground that is higher than assumed: late in its swing it
    touches, not on an edge of its sole, and does not come down where it is guided. Used only by
    gaits for rough ground."""
    c, w, foot = t.walk, t.walk.swing, t.walk.memory.foot
    late = w.time > LANDING * w.duration
    if t.gait.lower <= 0.0 or footholds_given(t) or not late or c.state.contacts[foot] < 0.5:
        return False
    above = c.state.sole_point[foot, 2] - w.reference[0, 2]
    return above > HELD_UP * c.robot.height_com and c.state.sole_axes[foot, 2, 2] > FLAT


@compiled
def lift_off(t: WalkTick) -> None:
    """Begin the swing of the foot that did not step last."""
    c, m = t.walk, t.walk.memory
    foot = 1 - m.foot
    m.steps += 1
    m.foot, m.swinging, m.load_fraction, m.corners = foot, 1, 0.0, 0
    t.gait.starting = 0
    point = c.state.sole_point
    start_swing(c.swing, point[foot], point[1 - foot, 2], step_time(t.gait))
    copy_into(point[foot], t.gait.treads.left)


@compiled
def touch_down(t: WalkTick) -> None:
    """End a swing, and sum up how far the velocity of the last step was off."""
    g, m, feet = t.gait, t.walk.memory, t.walk.state.sole_point
    m.swinging, m.clock, g.clock = 0, 0.0, 0.0
    x, y = 0.5 * (feet[0, 0] + feet[1, 0]), 0.5 * (feet[0, 1] + feet[1, 1])
    if g.step_clock > 0.0:
        level = m.level_frame
        dx, dy = along(level[0, 0], level[1, 0], x - g.middle[0], y - g.middle[1])
        most = g.correction_limit
        for a, way in ((0, dx), (1, dy)):
            error = g.error[a] + g.correction * (g.velocity[a] - way / g.step_clock)
            g.error[a] = min(max(error, -most), most)
    g.middle[0], g.middle[1], g.step_clock = x, y, 0.0


@compiled
def has_stopped(t: WalkTick) -> bool:
    """Return whether the walk is over: nothing is asked for, and ξ is held by both soles."""
    c, g, v = t.walk, t.gait, t.gait.velocity
    if is_commanded(g) or np.sqrt(v[0] * v[0] + v[1] * v[1]) > g.speed_margin:
        return False
    if g.starting:
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
    t.gait.walking = 0
    t.walk.memory.clock, t.walk.memory.corners = 0.0, 0
    go_on_from(t.capture.on_both, t.walk.on_both.applied)


@compiled
def may_walk(t: WalkTick) -> bool:
    """Return whether a walk may begin: after a catch once both soles have been down for a while."""
    m = t.walk.memory
    return not m.swinging and (not t.gait.caught or m.clock > t.gait.calm_time)


@compiled
def count_failures(t: WalkTick) -> None:
    """Count the ticks that no QP could solve."""
    c = t.capture
    failures = c.standing.memory.failures + c.on_both.memory.failures
    c.failures = failures + t.walk.on_both.memory.failures


@compiled
def gait_tick(t: WalkTick) -> bool:
    """A tick of the walk; False instead of torques where it is over."""
    m = t.walk.memory
    follow_command(t)
    copy_reference(t.walk)
    if footholds_given(t) and t.gait.treads.lean > 0.0:
        lean_ahead(t)
    if m.swinging and (has_landed(t.walk) or stands_higher(t)):
        touch_down(t)
    if not m.swinging:
        if has_stopped(t):
            stop_walking(t)
            return False
        if transfer_tick(t):
            lift_off(t)
    if m.swinging and not swing_tick(t):
        stop_walking(t)
        t.gait.caught = 1
        return False
    return True


@compiled
def walk_tick(t: WalkTick) -> None:
    """One tick of `Walk`: `tau` then holds torques.

    What pushes is watched, for when it stands again, but the gait does not lean against it: with
    ξ + k F̂ h/W for ξ it fell more often in side wind.
    """
    g = t.gait
    if not g.walking and is_commanded(g) and may_walk(t):
        start_walking(t)
    if not g.walking or not gait_tick(t):
        capture_tick(t.capture)
    elif t.capture.standing.compensation.active:
        watch(t.capture.standing.compensation)
    count_failures(t)
