"""A tick of `MotionStep` in a motion with steps; `perform_tick` is where to begin.

While it performs, the soles in contact are those of the schedule, the swing foot follows the
motion's, and the CoM c̈ = ω² (c − p − δ) with p = p_ref + (1 + k) (ξ − ξ_ref), kept within what the
soles reach [Englsberger11]; δ is what the motion's angular momentum does. When p_ref + ξ − ξ_ref is
beyond that, no CoP brings ξ back, and the planner of steps takes over. Once it has come to rest the
motion goes on from the new stance.
"""

import numpy as np

from poise.baselines.balance.references.targets import root_reference
from poise.baselines.balance.stepping.planning.guidance import limit_posture
from poise.baselines.balance.stepping.planning.swing import LANDING, start_swing
from poise.baselines.balance.stepping.tick import (
    FIRST_LOAD,
    capture_tick,
    has_landed,
    solve_contacts,
)
from poise.baselines.whole_body.tick import go_on_from
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import copy_into, rotated, turned

from .blocks import PerformTick
from .catching import ask_to_rest, go_on, leave, may_go_on
from .schedule import (
    beyond_reach,
    face,
    flies,
    lifted_foot,
    motion_time,
    next_switch,
    phase_at,
    put_frame,
    reached_region,
    sample_footing,
    squared_rate,
    turn_to_world,
    wanted_cop,
)

UNLOADED, LEAST_LOAD = 1.15, 0.03  # [m g] that a foot may bear when it begins to, and as it, leaves
AIR, WEIGHTLESS = 30.0, 0.01  # [1/s] of soles in flight; [m g] that they bear then
LEAST_SHARE = 0.1  # of the acceleration asked of soles in flight, that is tried
SETTLING = 0.3  # [s] before the first lift-off until which the motion's frame is that of the soles


@compiled
def perform_targets(t: PerformTick, corners: int) -> None:
    """The targets of a tick that performs."""
    c, p, s, own, given = t.own, t.performance, t.own.state, t.own.reference_out, t.given
    wanted_cop(t, p.gain, c.vector)
    find_nearest(c.memory.region[:corners], c.vector, c.pair)
    rate = squared_rate(t)
    for a in range(2):
        own.cop[a] = c.pair[a]
        own.com[a], own.com_vel[a] = s.com[a], s.com_vel[a]
        own.com_acc[a] = rate * (s.com[a] - own.cop[a] - p.momentum_offset[0, a])
    own.com[2], own.com_vel[2], own.com_acc[2] = p.com[0, 2], p.com[1, 2], p.com[2, 2]
    copy_into(given.q_ref, own.q_ref)
    copy_into(given.v_ref, own.v_ref)
    copy_into(given.angular_momentum, own.angular_momentum)
    root_reference(c.robot, p.cos, p.sin, p.root, own)
    limit_posture(c)
    for j in range(own.a_ref.shape[0]):
        own.a_ref[j] += given.a_ref[j]


@compiled
def shift_loads(t: PerformTick, time: float) -> None:
    """Let the load go to the foot that has landed, and leave the one that lifts off next."""
    c, p, m = t.own, t.performance, t.own.memory
    weight, limits = c.robot.mass * c.robot.gravity, c.on_both.load_limits
    limits[0] = limits[1] = np.inf
    if m.steps > 0:
        limits[m.foot] = weight * (FIRST_LOAD + m.clock / p.load_time)
    switch = next_switch(t, time)
    left = switch - time
    if left < p.unload_time:
        phase = phase_at(p.switches, switch + 1e-9)
        foot = lifted_foot(t, phase)
        if foot >= 0 and not flies(t, phase):
            most = max(UNLOADED * left / p.unload_time, LEAST_LOAD)
            limits[foot] = min(limits[foot], weight * most)
    c.on_both.limited = 1


@compiled
def begin_swing(t: PerformTick, foot: int, phase: int) -> None:
    """Begin the swing of a foot."""
    c, p, m = t.own, t.performance, t.own.memory
    m.steps += 1
    m.foot, m.swinging, m.load_fraction, m.corners = foot, 1, 0.0, 0
    p.begun = phase
    duration = p.switches[phase] - p.switches[phase - 1]
    start_swing(c.swing, c.state.sole_point[foot], p.floor, duration)


@compiled
def follow_foot(t: PerformTick) -> None:
    """Lead the swinging sole as the motion does; down, once it should have landed."""
    c, p, w, foot = t.own, t.performance, t.own.swing, t.own.memory.foot
    place, turn = p.places[foot], p.turns[foot, 0]
    late = w.time - w.duration
    for r in range(3):
        for a in range(3):
            w.reference[r, a] = place[r, a]
    if late > 0.0:
        w.reference[0, 2] -= p.landing_speed * late
        w.reference[1, 2] = -p.landing_speed
    w.foothold[0], w.foothold[1] = place[0, 0], place[0, 1]
    x, y, z = turn[0], turn[1], turn[2]
    angle = np.sqrt(x * x + y * y + z * z)
    if angle > 1e-12:
        x, y, z = x / angle, y / angle, z / angle
    cos, sin, level = np.cos(angle), np.sin(angle), t.own.vector
    for a in range(3):
        for b in range(3):
            level[b] = 1.0 if a == b else 0.0
        u, v, up = rotated(x, y, z, cos, sin, level)
        t.axes[0, a], t.axes[1, a] = turned(p.cos, p.sin, u, v)
        t.axes[2, a] = up
    w.time += c.gains.period


@compiled
def in_flight(t: PerformTick, phase: int, time: float) -> bool:
    """Return whether the robot is in flight: from the motion's take-off until a sole touches the
    ground, late in the flight."""
    s, p = t.own.state, t.performance
    if flies(t, phase) and p.begun != phase and not t.own.memory.swinging:
        p.begun, p.flying = phase, 1
    if p.flying:
        last, end = p.switches[p.begun - 1], p.switches[p.begun]
        late = time > last + LANDING * (end - last)
        if late and (s.contacts[0] > 0.5 or s.contacts[1] > 0.5):
            p.flying = 0
            t.own.memory.clock = 0.0
    return p.flying == 1


@compiled
def lead_soles(t: PerformTick, time: float, share: float) -> None:
    """Set the accelerations of soles in flight: free fall and the `share` of what guides them to
    the motion's."""
    c, p, s = t.own, t.performance, t.own.state
    problem = c.on_both.problem
    accel, damping = problem.workspace.sole_accel, problem.parameters.sole_damping
    late = max(time - p.switches[p.begun], 0.0)
    for foot in range(2):
        up, place = s.sole_axes[foot, :, 2], p.places[foot]
        for a in range(3):
            r = 6 * foot + a
            gap = place[0, a] - s.sole_point[foot, a]
            if a == 2:
                gap -= p.landing_speed * late
            rate = place[1, a] - s.J_v[r]
            accel[r] = place[2, a] + AIR**2 * gap + 2.0 * AIR * rate
            accel[r + 3] = -2.0 * AIR * s.J_v[r + 3]
        accel[6 * foot + 3] += AIR**2 * up[1]
        accel[6 * foot + 4] -= AIR**2 * up[0]
        for r in range(6 * foot, 6 * foot + 6):
            accel[r] = share * accel[r] + damping * s.J_v[r]
        accel[6 * foot + 2] -= (1.0 - share) * c.robot.gravity


@compiled
def fly(t: PerformTick, time: float) -> None:
    """A tick in flight: soles follow the motion, and bear nothing.

    Where the motors cannot follow, a smaller share is asked.
    """
    c = t.own
    contacts = c.on_both
    accel, memory = contacts.problem.workspace.sole_accel, contacts.memory
    for foot in range(2):
        contacts.load_limits[foot] = WEIGHTLESS * c.robot.mass * c.robot.gravity
    contacts.limited = 1
    perform_targets(t, reached_region(t))
    share, failures = 1.0, memory.failures
    while True:
        lead_soles(t, time, share)
        solve_contacts(c, contacts)
        if memory.failures == failures or share < LEAST_SHARE:
            break
        go_on_from(contacts, memory.torques)
        memory.failures, share = failures, 0.5 * share
    for r in range(accel.shape[0]):
        accel[r] = 0.0


@compiled
def perform(t: PerformTick, time: float) -> bool:
    """A tick of the performance; False instead of torques where the planner has to take over."""
    c, p, m = t.own, t.performance, t.own.memory
    phase = phase_at(p.switches, time)
    if m.steps == 0 and next_switch(t, time) - time > SETTLING:
        put_frame(t)
    turn_to_world(t)
    if m.swinging and has_landed(c):
        m.swinging, m.clock = 0, 0.0
    if in_flight(t, phase, time):
        fly(t, time)
        return True
    foot = lifted_foot(t, phase)
    if not m.swinging and foot >= 0 and p.begun != phase and not flies(t, phase):
        begin_swing(t, foot, phase)
    face(t)
    corners = reached_region(t)
    if beyond_reach(t, corners) > (p.margin if m.swinging else p.margin_both):
        leave(t)
        return False
    perform_targets(t, corners)
    if m.swinging:
        follow_foot(t)
        contacts = c.on_second if m.foot == 0 else c.on_first
        contacts.limited = 0
    else:
        contacts = c.on_both
        shift_loads(t, time)
        m.clock += c.gains.period
    solve_contacts(c, contacts)
    return True


@compiled
def perform_tick(t: PerformTick) -> None:
    """One tick of `MotionStep` in a motion with steps: `tau` of the capture's block then holds
    torques."""
    c, p = t.capture, t.performance
    time = motion_time(t)
    p.clock += t.own.gains.period
    sample_footing(t, time)
    if not p.performing and may_go_on(t, time):
        go_on(t)
        sample_footing(t, time)
    if not p.performing or not perform(t, time):
        ask_to_rest(t)
        capture_tick(c)
    failures = c.standing.memory.failures + c.on_both.memory.failures
    c.failures = failures + t.own.on_both.memory.failures
