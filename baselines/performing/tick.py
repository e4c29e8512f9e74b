"""A tick of `MotionStep` in a motion with steps; `perform_tick` is where to begin.

While it performs, the soles in contact are those of the schedule, the foot in the air follows the
motion's, and the CoM c̈ = ω² (c − p − δ) with p = p_ref + (1 + k) (ξ − ξ_ref), kept within what the
soles reach [Englsberger11]; δ is what the motion's angular momentum does. When p_ref + ξ − ξ_ref is
beyond that, no CoP brings ξ back, and the planner of steps takes over. Once it has come to rest the
motion goes on from the new stance.
"""

import numpy as np

from poise.baselines.motions.footing import COM, PLACE, ROOT, SPIN, TURN
from poise.baselines.motions.splines import evaluate
from poise.baselines.motions.targets import root_reference
from poise.baselines.motions.tempo import CHANGE, RATE, TIME
from poise.baselines.stepping.cop_region import double_support_region, single_support_region
from poise.baselines.stepping.guidance import limit_posture
from poise.baselines.stepping.recentring import set_level_frame, stop_recentring
from poise.baselines.stepping.swing import start_swing
from poise.baselines.stepping.tick import (
    FIRST_LOAD,
    capture_tick,
    has_landed,
    solve_contacts,
)
from poise.baselines.whole_body.tick import ContactTick
from poise.envs.compiled.jit import compiled
from poise.envs.maths.polygons import find_nearest
from poise.envs.maths.vectors import along, copy_into, rotated, turned

from .blocks import COS, GROUND, SIN, PerformTick, X, Y

UNLOADED, LEAST_LOAD = 1.15, 0.03  # [m g] that a foot may bear when it begins to, and as it, leaves
SETTLING = 0.3  # [s] before the first lift-off until which the motion's frame is that of the soles
AHEAD = 0.4  # [s] before a lift-off by which the motion must have gone on


@compiled
def go_on_from(contacts: ContactTick, torques: np.ndarray) -> None:
    """Let the next tick change these `torques` (nv−6,) of the last one no more than it may."""
    copy_into(torques, contacts.applied)
    copy_into(torques, contacts.memory.torques)
    contacts.follows[0] = 1


@compiled
def motion_time(t: PerformTick) -> float:
    """The motion's own time [s]."""
    p = t.performance
    return p.pace.memory[TIME] if p.pace.waits else p.clock[0]


@compiled
def phase_at(switches: np.ndarray, time: float) -> int:
    """The row of `planted` that holds at a time [s]."""
    return int(np.searchsorted(switches, time, side="right"))


@compiled
def next_switch(t: PerformTick, time: float) -> float:
    """When the planted soles change next [s]; infinite after the last step."""
    switches = t.performance.switches
    i = phase_at(switches, time)
    return switches[i] if i < switches.shape[0] else np.inf


@compiled
def lifted_foot(t: PerformTick, phase: int) -> int:
    """The foot that is in the air in a phase; −1: none."""
    planted = t.performance.planted
    for foot in range(2):
        if planted[phase, foot] == 0:
            return foot
    return -1


@compiled
def sample_footing(t: PerformTick, time: float) -> None:
    """The motion's CoM, root and soles, into `samples`, in the motion's frame."""
    p = t.performance
    evaluate(p.knots, p.coeffs, False, time, p.samples[0], p.samples[1], p.samples[2])
    if p.pace.waits:
        rate, change = p.pace.memory[RATE], p.pace.memory[CHANGE]
        for j in range(p.samples.shape[1]):
            p.samples[2, j] = rate * rate * p.samples[2, j] + change * p.samples[1, j]
            p.samples[1, j] *= rate


@compiled
def put_frame(t: PerformTick) -> None:
    """Let the motion's frame be where its soles are as the robot's are now."""
    s, p = t.own.state, t.performance
    feet, place = s.sole_point, p.samples[0]
    p.frame[COS], p.frame[SIN] = s.heading[0], s.heading[1]
    x = 0.5 * (place[PLACE[0]] + place[PLACE[1]])
    y = 0.5 * (place[PLACE[0] + 1] + place[PLACE[1] + 1])
    x, y = turned(s.heading[0], s.heading[1], x, y)
    p.frame[X] = 0.5 * (feet[0, 0] + feet[1, 0]) - x
    p.frame[Y] = 0.5 * (feet[0, 1] + feet[1, 1]) - y
    p.frame[GROUND] = 0.5 * (feet[0, 2] + feet[1, 2])
    set_level_frame(t.own.memory.level_frame, p.frame[COS], p.frame[SIN])


@compiled
def to_world(t: PerformTick) -> None:
    """Turn CoM and places of `samples` to the world."""
    p = t.performance
    for column in (COM, PLACE[0], PLACE[1], SPIN):
        for r in range(3):
            x, y = p.samples[r, column], p.samples[r, column + 1]
            x, y = turned(p.frame[COS], p.frame[SIN], x, y)
            p.samples[r, column], p.samples[r, column + 1] = x, y
        if column != SPIN:
            p.samples[0, column] += p.frame[X]
            p.samples[0, column + 1] += p.frame[Y]
            p.samples[0, column + 2] += p.frame[GROUND]


@compiled
def stance_differs(t: PerformTick) -> bool:
    """Return whether the feet stand otherwise to each other than the motion's do now."""
    s, p = t.own.state, t.performance
    feet, place = s.sole_point, p.samples[0]
    x, y = along(
        s.heading[0], s.heading[1], feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    )  # fmt: skip
    x -= place[PLACE[0]] - place[PLACE[1]]
    y -= place[PLACE[0] + 1] - place[PLACE[1] + 1]
    return np.sqrt(x * x + y * y) > p.stance_error


@compiled
def pendulum_rate(t: PerformTick) -> float:
    """ω² = (g + c̈_z)/(c_z − ground) of the motion [1/s²]."""
    p = t.performance
    height = p.samples[0, COM + 2] - p.frame[GROUND]
    return (t.own.robot.gravity + p.samples[2, COM + 2]) / max(height, 1e-3)


@compiled
def wanted_cop(t: PerformTick, gain: float, out: np.ndarray) -> None:
    """p_ref + (1 + gain) (ξ − ξ_ref) into `out` (≥ 2,) [m]; p_ref = c − c̈/ω² − δ is the ZMP."""
    s, samples = t.own.state, t.performance.samples
    rate = pendulum_rate(t)
    omega = np.sqrt(rate)
    for a in range(2):
        j = COM + a
        error = s.com[a] - samples[0, j] + (s.com_vel[a] - samples[1, j]) / omega
        zmp = samples[0, j] - samples[2, j] / rate - samples[0, SPIN + a]
        out[a] = zmp + (1.0 + gain) * error


@compiled
def reached_region(t: PerformTick) -> int:
    """The corners of what the soles in contact reach, into `memory.region`; how many they are."""
    c, m = t.own, t.own.memory
    feet, level, region = c.state.sole_point, m.level_frame, t.own.search.region
    cos, sin = level[0, 0], level[1, 0]
    if m.swinging[0]:
        stance = 1 - m.foot[0]
        return single_support_region(region, stance, feet[stance], cos, sin, m.region)
    return double_support_region(region, feet, cos, sin, c.cloud, m.region)


@compiled
def beyond_reach(t: PerformTick, corners: int) -> float:
    """How far the least CoP that keeps ξ − ξ_ref from growing is outside what soles reach [m]."""
    c = t.own
    wanted_cop(t, 0.0, c.vector)
    find_nearest(c.memory.region[:corners], c.vector, c.pair)
    x, y = c.vector[0] - c.pair[0], c.vector[1] - c.pair[1]
    return np.sqrt(x * x + y * y)


@compiled
def ask_for(t: PerformTick, corners: int) -> None:
    """The targets of a tick that performs."""
    c, p, s, own, given = t.own, t.performance, t.own.state, t.own.reference_out, t.given
    wanted_cop(t, p.gain, c.vector)
    find_nearest(c.memory.region[:corners], c.vector, c.pair)
    rate = pendulum_rate(t)
    for a in range(2):
        own.cop[a] = c.pair[a]
        own.com[a], own.com_vel[a] = s.com[a], s.com_vel[a]
        own.com_acc[a] = rate * (s.com[a] - own.cop[a] - p.samples[0, SPIN + a])
    own.com[2] = p.samples[0, COM + 2]
    own.com_vel[2], own.com_acc[2] = p.samples[1, COM + 2], p.samples[2, COM + 2]
    copy_into(given.q_ref, own.q_ref)
    copy_into(given.v_ref, own.v_ref)
    copy_into(given.angular_momentum, own.angular_momentum)
    root_reference(c.robot, p.frame[COS], p.frame[SIN], p.samples[:, ROOT : ROOT + 3], own)
    limit_posture(c)
    for j in range(own.a_ref.shape[0]):
        own.a_ref[j] += given.a_ref[j]


@compiled
def limit_loads(t: PerformTick, time: float) -> None:
    """Let the load go to the foot that has landed, and leave the one that lifts off next."""
    c, p, m = t.own, t.performance, t.own.memory
    weight, limits = c.robot.mass * c.robot.gravity, c.on_both.load_limits
    limits[0] = limits[1] = np.inf
    if m.steps[0] > 0:
        limits[m.foot[0]] = weight * (FIRST_LOAD + m.clock[0] / p.load_time)
    switch = next_switch(t, time)
    left = switch - time
    if left < p.unload_time:
        foot = lifted_foot(t, phase_at(p.switches, switch + 1e-9))
        if foot >= 0:
            most = max(UNLOADED * left / p.unload_time, LEAST_LOAD)
            limits[foot] = min(limits[foot], weight * most)
    c.on_both.limited[0] = 1


@compiled
def lift_off(t: PerformTick, foot: int, phase: int) -> None:
    """Begin the swing of a foot."""
    c, p, m = t.own, t.performance, t.own.memory
    m.steps[0] += 1
    m.foot[0], m.swinging[0], m.load_fraction[0], m.corners[0] = foot, 1, 0.0, 0
    p.begun[0] = phase
    duration = p.switches[phase] - p.switches[phase - 1]
    start_swing(c.swing, c.state.sole_point[foot], p.frame[GROUND], duration)


@compiled
def follow_foot(t: PerformTick) -> None:
    """Lead the swinging sole as the motion does; down, once it should have landed."""
    c, p, w, foot = t.own, t.performance, t.own.swing, t.own.memory.foot[0]
    place, turn = PLACE[foot], TURN[foot]
    late = w.time[0] - w.duration[0]
    for r in range(3):
        for a in range(3):
            w.reference[r, a] = p.samples[r, place + a]
    if late > 0.0:
        w.reference[0, 2] -= p.landing_speed * late
        w.reference[1, 2] = -p.landing_speed
    w.foothold[0], w.foothold[1] = p.samples[0, place], p.samples[0, place + 1]
    x, y, z = p.samples[0, turn], p.samples[0, turn + 1], p.samples[0, turn + 2]
    angle = np.sqrt(x * x + y * y + z * z)
    if angle > 1e-12:
        x, y, z = x / angle, y / angle, z / angle
    cos, sin, level = np.cos(angle), np.sin(angle), t.own.vector
    for a in range(3):
        for b in range(3):
            level[b] = 1.0 if a == b else 0.0
        u, v, up = rotated(x, y, z, cos, sin, level)
        t.axes[0, a], t.axes[1, a] = turned(p.frame[COS], p.frame[SIN], u, v)
        t.axes[2, a] = up
    w.time[0] += c.gains.period


@compiled
def leave(t: PerformTick) -> None:
    """Hand over to the planner of steps, in the middle of a swing too."""
    c, p, m, w = t.capture, t.performance, t.own.memory, t.own.swing
    p.performing[0], p.rested[0] = 0, 0.0
    p.left[0] += 1
    stop_recentring(c.recentring)
    m.recovering[0], m.corners[0] = 0, 0
    go_on_from(c.on_both, t.own.on_both.applied)
    if m.swinging[0]:
        m.recovering[0], m.load_fraction[0] = 1, 0.0
        w.time[0], w.time_offset[0] = 0.0, 0.0
        w.duration[0] = c.search.time_max
    elif m.steps[0] == 0:
        ws = c.standing.problem.workspace
        copy_into(t.own.on_both.applied, ws.tau)
        copy_into(t.own.on_both.problem.workspace.wrenches, ws.wrenches)


@compiled
def may_go_on(t: PerformTick, time: float) -> bool:
    """Return whether the motion can go on from here; then its frame is put under it."""
    p, m, period = t.performance, t.own.memory, t.own.gains.period
    p.rested[0] = 0.0 if m.swinging[0] or m.recovering[0] else p.rested[0] + period
    if p.rested[0] < p.rest_time or lifted_foot(t, phase_at(p.switches, time)) >= 0:
        return False
    if next_switch(t, time) - time < AHEAD or stance_differs(t):
        return False
    put_frame(t)
    to_world(t)
    return beyond_reach(t, reached_region(t)) <= 0.0


@compiled
def ask_to_rest(t: PerformTick) -> None:
    """The targets while it catches itself: standing, with the motion's trunk and arms."""
    s, own, given, robot = t.own.state, t.resting, t.given, t.own.robot
    copy_into(given.q_ref, own.q_ref)
    copy_into(given.v_ref, own.v_ref)
    copy_into(given.a_ref, own.a_ref)
    for i in range(t.legs.shape[0]):
        j = t.legs[i]
        own.q_ref[j], own.v_ref[j], own.a_ref[j] = robot.q_standing[j], 0.0, 0.0
    cos, sin = s.heading[0], s.heading[1]
    for a in range(3):
        x, y = robot.root_standing[0, a], robot.root_standing[1, a]
        own.root_axes[0, a], own.root_axes[1, a] = turned(cos, sin, x, y)
        own.root_axes[2, a] = robot.root_standing[2, a]
        own.root_vel[a] = own.root_acc[a] = own.com_vel[a] = own.com_acc[a] = 0.0
        own.angular_momentum[a] = 0.0
    own.com[0], own.com[1] = s.origin[0] + cos * t.com_offset, s.origin[1] + sin * t.com_offset
    own.com[2] = s.origin[2] + robot.height_com
    own.cop[0], own.cop[1] = own.com[0], own.com[1]


@compiled
def perform(t: PerformTick, time: float) -> bool:
    """A tick of the performance; False instead of torques where the planner has to take over."""
    c, p, m = t.own, t.performance, t.own.memory
    phase = phase_at(p.switches, time)
    if m.steps[0] == 0 and next_switch(t, time) - time > SETTLING:
        put_frame(t)
    to_world(t)
    if m.swinging[0] and has_landed(c):
        m.swinging[0], m.clock[0] = 0, 0.0
    foot = lifted_foot(t, phase)
    if not m.swinging[0] and foot >= 0 and p.begun[0] != phase:
        lift_off(t, foot, phase)
    corners = reached_region(t)
    if beyond_reach(t, corners) > (p.margin if m.swinging[0] else p.margin_both):
        leave(t)
        return False
    ask_for(t, corners)
    if m.swinging[0]:
        follow_foot(t)
        contacts = c.on_second if m.foot[0] == 0 else c.on_first
        contacts.limited[0] = 0
    else:
        contacts = c.on_both
        limit_loads(t, time)
        m.clock[0] += c.gains.period
    solve_contacts(c, contacts)
    return True


@compiled
def go_on(t: PerformTick) -> None:
    """Perform again, from the stance that the planner has led to."""
    c, p, m = t.capture, t.performance, t.own.memory
    before = c.standing.problem.workspace.tau if m.steps[0] == 0 else c.on_both.applied
    go_on_from(t.own.on_both, before)
    p.performing[0], m.corners[0] = 1, 0
    stop_recentring(c.recentring)


@compiled
def perform_tick(t: PerformTick) -> None:
    """One tick of `MotionStep` in a motion with steps: `tau` of the capture's block holds torques,
    unless `to_python` says that Python must."""
    c, p = t.capture, t.performance
    c.to_python[0] = 0
    time = motion_time(t)
    p.clock[0] += t.own.gains.period
    sample_footing(t, time)
    if not p.performing[0] and may_go_on(t, time):
        go_on(t)
        sample_footing(t, time)
    if not p.performing[0] or not perform(t, time):
        ask_to_rest(t)
        capture_tick(c)
    failures = c.standing.memory.failures[0] + c.on_both.memory.failures[0]
    c.failures[0] = failures + t.own.on_both.memory.failures[0]
