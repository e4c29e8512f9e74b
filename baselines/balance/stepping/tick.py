"""A tick of `CaptureStep`, compiled: when to step, the swing, and what the QPs are asked for.

`capture_tick` is where to begin. All that a tick works on has its name in `blocks.py`.
"""

import numpy as np

from poise.baselines.whole_body.compensation import watch
from poise.baselines.whole_body.tick import ContactTick, go_on_from
from poise.envs.compiled.calls import call
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.physics.kinematics import borne_weight

from .planning.blocks import CaptureTick
from .planning.cop_region import distance_beyond, double_support_region, single_support_region
from .planning.guidance import (
    copy_reference,
    crouch,
    guide_com,
    moves,
    return_to_motion,
    turned_away,
)
from .planning.recentring import (
    INACTIVE,
    SWINGING,
    end_recentring_swing,
    lower_foot,
    plan_recentring,
    recentring_step_due,
    replan_recentring,
    set_level_frame,
    slipped_foot,
    stop_recentring,
)
from .planning.search import plan_step, replan_step, set_capture_point
from .planning.swing import FROZEN, LANDING, advance_over, aim_swing, start_swing, time_left

LEAD = 0.7  # [1/ω] by which the turn of the root is looked ahead; in a crouch by less
DEEP = 0.1  # [h] of a crouch in which it is not
AWAY = 1.0  # [rad/s] a slower turn is no reason for a step
LOW = 0.04  # [h] above the ground: a foot that touches it higher up stands on its edge
FIRST_LOAD = 0.3  # [m g] that a foot may bear at touchdown; then the limit rises
FZ = 2  # of a sole's wrench


@compiled
def must_step(t: CaptureTick) -> bool:
    """Return whether ξ is so far outside the CoP region of both soles that a step begins.

    `CaptureStepConfig` has the distance."""
    s, m, g, q, feet = t.state, t.memory, t.gains, t.search, t.state.sole_point
    if m.recovering > 0:
        if m.clock < g.double_support_time:
            return False
        q.heading[0], q.heading[1] = m.level_frame[0, 0], m.level_frame[1, 0]
        set_capture_point(q)
        x, y = q.capture_point[0], q.capture_point[1]
        cos, sin = q.heading[0], q.heading[1]
        outside = distance_beyond(
            q.region, feet[0, 0], feet[0, 1], feet[1, 0], feet[1, 1], cos, sin, x, y
        )
        return outside > g.restep_margin + t.offsets.trigger
    x, y = s.capture_point[0], s.capture_point[1]
    cos, sin = s.heading[0], s.heading[1]
    outside = distance_beyond(
        q.region, feet[0, 0], feet[0, 1], feet[1, 0], feet[1, 1], cos, sin, x, y
    )
    x, y = x - s.origin[0], y - s.origin[1]  # of the fall
    turning = (x * s.momentum[4] - y * s.momentum[3]) / max(np.sqrt(x * x + y * y), 1e-9)
    margin = g.step_margin
    if moves(t):
        angle, rate = turned_away(t)
        low = crouch(t)
        lead = LEAD / s.omega * max(1.0 - low / (DEEP * t.robot.height_com), 0.0)
        if rate > AWAY and angle + lead * rate > g.turn_limit:
            return True
        margin += g.crouch_margin * low * max(1.0 - (angle / g.turn_limit) ** 2, 0.0)
    return outside + g.momentum_gain * turning > margin + t.offsets.trigger


@compiled
def begin_step(t: CaptureTick, to_nominal: bool) -> None:
    """Plan a step that catches the fall, or one back to the nominal stance, and start its swing."""
    s, m, q = t.state, t.memory, t.search
    wrenches = t.on_both.problem.workspace.wrenches
    if m.steps == 0:
        go_on_from(t.on_both, t.standing.problem.workspace.tau)
        wrenches = t.standing.problem.workspace.wrenches
    if m.recovering == 0:
        set_level_frame(m.level_frame, s.heading[0], s.heading[1])
    q.heading[0], q.heading[1] = m.level_frame[0, 0], m.level_frame[1, 0]
    q.feedback.signals.later_step = 1.0 if m.recovering > 0 else 0.0
    if to_nominal:
        plan_recentring(q, t.recentring)
    else:
        stop_recentring(t.recentring)
        plan_step(q)
    foot = q.best_foot
    m.steps += 1
    m.recovering, m.return_fraction = 1, 0.0
    m.foot, m.swinging = foot, 1
    start_swing(t.swing, s.sole_point[foot], s.sole_point[1 - foot, 2], q.best_time)
    aim_swing(t.swing, q.best_x, q.best_y, q.best_time)
    t.swing.time_offset = q.best_offset
    m.load, m.load_fraction = wrenches[6 * foot + FZ], 1.0


@compiled
def has_landed(t: CaptureTick) -> bool:
    """Return whether the foot touches the ground, late in its swing and level."""
    s, w, foot = t.state, t.swing, t.memory.foot
    low = s.sole_point[foot, 2] - w.ground < LOW * t.robot.height_com
    return s.contacts[foot] > 0.5 and w.time > LANDING * w.duration and low


@compiled
def solve_contacts(t: CaptureTick, contacts: ContactTick) -> None:
    """Torques with these soles in contact."""
    call(t.contact_kernel, contacts)
    copy_into(contacts.problem.workspace.tau, t.tau)
    copy_into(contacts.problem.workspace.vdot, t.vdot)


@compiled
def limit_load(t: CaptureTick, most: float) -> None:
    """Limit the load of the foot that steps [N]; the other one bears what there is."""
    t.on_both.load_limits[0] = t.on_both.load_limits[1] = np.inf
    t.on_both.load_limits[t.memory.foot] = most
    t.on_both.limited = 1


@compiled
def replan_swing(t: CaptureTick) -> None:
    """Replan the rest of the running step, and guide its foot there."""
    m, w, q, r = t.memory, t.swing, t.search, t.recentring
    q.heading[0], q.heading[1] = m.level_frame[0, 0], m.level_frame[1, 0]
    if r.stage != SWINGING or not replan_recentring(q, r, w):
        r.stage = INACTIVE
        replan_step(q, m.foot, w)
    aim_swing(w, q.best_x, q.best_y, w.time + q.best_time)
    w.time_offset = q.best_offset


@compiled
def step_tick(t: CaptureTick) -> None:
    """A tick in a step: first the foot gives its load away, then it swings."""
    s, m, g, w, q = t.state, t.memory, t.gains, t.swing, t.search
    foot, level = m.foot, m.level_frame
    stance = s.sole_point[1 - foot]
    if time_left(w) > FROZEN:
        replan_swing(t)
    n = single_support_region(q.region, 1 - foot, stance, level[0, 0], level[1, 0], t.corners)
    stride_x, stride_y = w.foothold[0] - stance[0], w.foothold[1] - stance[1]
    guide_com(t, t.corners[:n], 0.0, stance[2], stride_x, stride_y)
    m.load_fraction -= g.period / max(g.unload_time, 1e-9)
    if m.load_fraction > 0.0:
        limit_load(t, m.load_fraction * max(m.load, 0.0))
        solve_contacts(t, t.on_both)
        return
    advance_over(w, w.apex, g.period)
    contacts = t.on_second if foot == 0 else t.on_first
    contacts.limited = 0
    solve_contacts(t, contacts)


@compiled
def double_support_tick(t: CaptureTick) -> None:
    """A tick on both feet, wherever they are."""
    m, g, feet, level = t.memory, t.gains, t.state.sole_point, t.memory.level_frame
    if m.corners == 0:  # feet have just come to rest
        m.corners = double_support_region(
            t.search.region, feet, level[0, 0], level[1, 0], t.cloud, m.region
        )
    stride_x, stride_y = feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    ground = 0.5 * (feet[0, 2] + feet[1, 2])
    guide_com(t, m.region[: m.corners], g.cop_overreach, ground, stride_x, stride_y)
    if m.moved:
        return_to_motion(t)
    t.on_both.limited = 0
    if m.clock < g.load_time:
        weight = borne_weight(t.robot, t.state)
        limit_load(t, weight * (FIRST_LOAD + m.clock / g.load_time))
    m.clock += g.period
    solve_contacts(t, t.on_both)


@compiled
def standing_tick(t: CaptureTick) -> None:
    """A tick before the first step: the QP with feet fixed."""
    call(t.standing_kernel, t.standing)
    copy_into(t.standing.problem.workspace.tau, t.tau)
    copy_into(t.standing.problem.workspace.vdot, t.vdot)
    t.failures = t.standing.memory.failures


@compiled
def capture_tick(t: CaptureTick) -> None:
    """One tick of `CaptureStep`: `tau` then holds torques."""
    m = t.memory
    if t.standing.compensation.active:
        watch(t.standing.compensation)
    if not m.moved and moves(t):
        m.moved = 1
    if not m.swinging:
        if must_step(t):
            begin_step(t, False)
        elif m.steps == 0:
            standing_tick(t)
            return
        elif recentring_step_due(t):
            begin_step(t, True)
    copy_reference(t)
    if m.swinging and has_landed(t):
        m.swinging, m.clock, m.corners = 0, 0.0, 0
        end_recentring_swing(t.recentring)
    if not m.swinging and t.recentring.homing:
        foot = slipped_foot(t)
        if foot >= 0:
            lower_foot(t, foot)
    if m.swinging:
        step_tick(t)
    else:
        double_support_tick(t)
    t.failures = t.standing.memory.failures + t.on_both.memory.failures
