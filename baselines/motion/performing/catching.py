"""How the planner of steps takes over from a performance, and how the motion goes on after it."""

from poise.baselines.balance.stepping.planning.recentring import stop_recentring
from poise.baselines.whole_body.tick import go_on_from
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into, turned

from .blocks import PerformTick
from .schedule import (
    beyond_reach,
    lifted_foot,
    next_switch,
    phase_at,
    put_frame,
    reached_region,
    stance_differs,
    turn_to_world,
)

AHEAD = 0.4  # [s] before a lift-off by which the motion must have gone on


@compiled
def leave(t: PerformTick) -> None:
    """Hand over to the planner of steps, in the middle of a swing too."""
    c, p, m, w = t.capture, t.performance, t.own.memory, t.own.swing
    p.performing, p.rested = 0, 0.0
    p.left += 1
    stop_recentring(c.recentring)
    m.recovering, m.corners, m.return_fraction = 0, 0, 0.0
    go_on_from(c.on_both, t.own.on_both.applied)
    if m.swinging:
        m.recovering, m.load_fraction = 1, 0.0
        w.time, w.time_offset = 0.0, 0.0
        w.duration = c.search.time_max
    elif m.steps == 0:
        ws = c.standing.problem.workspace
        copy_into(t.own.on_both.applied, ws.tau)
        copy_into(t.own.on_both.problem.workspace.wrenches, ws.wrenches)


@compiled
def may_go_on(t: PerformTick, time: float) -> bool:
    """Return whether the motion can go on from here; then its frame is put under it."""
    p, m, period = t.performance, t.own.memory, t.own.gains.period
    p.rested = 0.0 if m.swinging or m.recovering else p.rested + period
    if p.rested < p.rest_time or lifted_foot(t, phase_at(p.switches, time)) >= 0:
        return False
    if next_switch(t, time) - time < AHEAD or stance_differs(t):
        return False
    put_frame(t)
    turn_to_world(t)
    return beyond_reach(t, reached_region(t)) <= 0.0


@compiled
def go_on(t: PerformTick) -> None:
    """Perform again, from the stance that the planner has reached."""
    c, p, m = t.capture, t.performance, t.own.memory
    before = c.standing.problem.workspace.tau if m.steps == 0 else c.on_both.applied
    go_on_from(t.own.on_both, before)
    p.performing, m.corners = 1, 0
    stop_recentring(c.recentring)


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
