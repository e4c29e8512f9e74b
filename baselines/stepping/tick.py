"""A tick of `CaptureStep`, compiled: when to step, the swing, and what the QPs are asked for."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.baselines.whole_body.contact_sets import ContactTick
from poise.baselines.whole_body.momentum_qp import Tick
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import call
from poise.envs.compiled.jit import compiled
from poise.envs.maths.vectors import copy
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .guidance import copy_targets, guide
from .offsets import TRIGGER
from .reach import distance_beyond, reach_of_one, reach_of_two
from .recentring import (
    AWAY,
    SWINGING,
    HomeArrays,
    come_home,
    face,
    leave_home,
    lost_foot,
    lower_again,
    plan_home,
    replan_home,
    wants_home,
)
from .search import Search, plan_step, replan_step
from .swing import (
    FROZEN,
    LANDING,
    SwingArrays,
    advance_swing,
    aim_swing,
    start_swing,
    time_left,
)

LOW = 0.04  # [h] above the ground: a foot that touches it higher up stands on its edge
FIRST_LOAD = 0.3  # [m g] that a foot may bear at touchdown; then the limit rises by m g a ramp


@dataclass(frozen=True, eq=False)
class StepGains(Block):
    """The numbers of a `CaptureStepConfig` in m and s."""

    trigger: float
    spin: float  # [m per N·m·s]
    again: float
    gain: float
    hips: float
    leg: float  # length of the legs
    sink: float
    ramp: float
    unload: float
    pause: float
    root_accel: float
    swing_accel: float
    joint_accel: float
    period: float


@dataclass(frozen=True, eq=False)
class StepMemory(Block):
    """What outlives a tick."""

    steps: np.ndarray  # (1,) int: begun since the reset
    again: np.ndarray  # (1,) int: 1 from a step until all is calm and both feet are at home
    foot: np.ndarray  # (1,) int: that stepped last
    swinging: np.ndarray  # (1,) int: whether it is in the air, or about to leave
    level: np.ndarray  # (3, 3) axes of a level sole along the heading at the first step
    clock: np.ndarray  # (1,) since the last touchdown [s]
    load: np.ndarray  # (1,) of the foot that lifts off [N]
    left: np.ndarray  # (1,) share of it still borne
    region: np.ndarray  # (2 n + 1, 2) what both soles reach since the last touchdown
    corners: np.ndarray  # (1,) int: how many rows of it count; 0: not known


@dataclass(frozen=True, eq=False)
class CaptureTick(Block):
    """All that a tick works on."""

    robot: RobotArrays
    state: StateArrays
    given: TargetArrays
    guided: TargetArrays  # of our own
    gains: StepGains
    search: Search
    swing: SwingArrays
    memory: StepMemory
    home: HomeArrays
    shift: np.ndarray  # see `StepShift`
    first: ContactTick  # on the first sole, on the second, on both
    second: ContactTick
    both: ContactTick
    place: Tick  # feet in place
    tau: np.ndarray  # (nv−6,) what is found [N·m]
    failures: np.ndarray  # (1,) int: ticks that could not be solved
    to_python: np.ndarray  # (1,) int: 1 where the QP of `place` is left to Python
    points: np.ndarray  # (k, 2) scratch
    cloud: np.ndarray  # (n, 2) scratch
    pair: np.ndarray  # (2,) scratch
    error: np.ndarray  # (3,) scratch
    place_kernel: int  # address of `momentum_tick`; 0: another solver, which Python calls
    contact_kernel: int  # address of `contact_tick`


@compiled
def must_step(t: CaptureTick) -> bool:
    """Whether ξ has left what both soles reach, see `CaptureStepConfig`."""
    s, m, g, feet = t.state, t.memory, t.gains, t.state.sole_point
    stepped = m.again[0] > 0
    if stepped and m.clock[0] < g.pause:
        return False
    cos, sin = s.heading[0], s.heading[1]
    if stepped:
        cos, sin = m.level[0, 0], m.level[1, 0]
    x, y = s.capture_point[0], s.capture_point[1]
    away = distance_beyond(
        t.search.reach, feet[0, 0], feet[0, 1], feet[1, 0], feet[1, 1], cos, sin, x, y
    )
    if stepped:
        return away > g.again + t.shift[TRIGGER]
    x, y = x - s.origin[0], y - s.origin[1]  # of the fall
    turning = (x * s.momentum[4] - y * s.momentum[3]) / max(np.sqrt(x * x + y * y), 1e-9)
    return away + g.spin * turning > g.trigger + t.shift[TRIGGER]


@compiled
def begin_step(t: CaptureTick, home: bool):
    """Plan a step, or one home, and start its swing."""
    s, m, q = t.state, t.memory, t.search
    wrenches = t.both.problem.workspace.wrenches
    if m.steps[0] == 0:
        before = t.place.problem.workspace
        copy(before.tau, t.both.applied)
        copy(before.tau, t.both.memory.torques)
        t.both.follows[0] = 1
        wrenches = before.wrenches
    if m.again[0] == 0:
        face(m.level, s.heading[0], s.heading[1])
    q.heading[0], q.heading[1] = m.level[0, 0], m.level[1, 0]
    q.feedback.stage[0] = 1.0 if m.again[0] > 0 else 0.0
    if home:
        plan_home(q, t.home)
    else:
        leave_home(t.home)
        plan_step(q)
    foot = q.best_foot[0]
    m.steps[0] += 1
    m.again[0] = 1
    m.foot[0], m.swinging[0] = foot, 1
    start_swing(t.swing, s.sole_point[foot], s.sole_point[1 - foot, 2], q.best[2])
    aim_swing(t.swing, q.best[0], q.best[1], q.best[2])
    t.swing.shift[0] = q.best[4]
    m.load[0], m.left[0] = wrenches[6 * foot + 2], 1.0


@compiled
def has_landed(t: CaptureTick) -> bool:
    """Whether the foot touches the ground, late in its swing and level."""
    s, w, foot = t.state, t.swing, t.memory.foot[0]
    low = s.sole_point[foot, 2] - w.ground[0] < LOW * t.robot.height_com
    return s.contacts[foot] > 0.5 and w.time[0] > LANDING * w.duration[0] and low


@compiled
def solve_set(t: CaptureTick, chosen: ContactTick):
    """Torques with these soles in contact."""
    call(t.contact_kernel, chosen)
    copy(chosen.problem.workspace.tau, t.tau)


@compiled
def limit_load(t: CaptureTick, most: float):
    """Of the foot that steps [N]; the other one bears what there is."""
    t.both.load_limits[0] = t.both.load_limits[1] = np.inf
    t.both.load_limits[t.memory.foot[0]] = most
    t.both.limited[0] = 1


@compiled
def swing_tick(t: CaptureTick):
    """A tick on one foot."""
    s, m, g, w, q = t.state, t.memory, t.gains, t.swing, t.search
    foot, level = m.foot[0], m.level
    stance = s.sole_point[1 - foot]
    if time_left(w) > FROZEN:
        q.heading[0], q.heading[1] = level[0, 0], level[1, 0]
        if t.home.stage[0] != SWINGING or not replan_home(q, t.home, w):
            t.home.stage[0] = AWAY
            replan_step(q, foot, w)
        aim_swing(w, q.best[0], q.best[1], w.time[0] + q.best[2])
        w.shift[0] = q.best[4]
    n = reach_of_one(q.reach, 1 - foot, stance, level[0, 0], level[1, 0], t.points)
    way_x, way_y = w.foothold[0] - stance[0], w.foothold[1] - stance[1]
    guide(t, t.points[:n], 0.0, stance[2], way_x, way_y)
    m.left[0] -= g.period / max(g.unload, 1e-9)
    if m.left[0] > 0.0:  # the foot that will leave gives its load to the other one
        limit_load(t, m.left[0] * max(m.load[0], 0.0))
        solve_set(t, t.both)
        return
    advance_swing(w, g.period)
    chosen = t.second if foot == 0 else t.first
    chosen.limited[0] = 0
    solve_set(t, chosen)


@compiled
def stand_tick(t: CaptureTick):
    """A tick on both feet, wherever they are."""
    m, g, feet, level = t.memory, t.gains, t.state.sole_point, t.memory.level
    if m.corners[0] == 0:  # feet have just come to rest
        m.corners[0] = reach_of_two(
            t.search.reach, feet, level[0, 0], level[1, 0], t.cloud, m.region
        )
    way_x, way_y = feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    ground = 0.5 * (feet[0, 2] + feet[1, 2])
    guide(t, m.region[: m.corners[0]], g.hips, ground, way_x, way_y)
    t.both.limited[0] = 0
    if m.clock[0] < g.ramp:
        weight = t.robot.mass * t.robot.gravity
        limit_load(t, weight * (FIRST_LOAD + m.clock[0] / g.ramp))
    m.clock[0] += g.period
    solve_set(t, t.both)


@compiled
def capture_tick(t: CaptureTick):
    """One tick of `CaptureStep`: `tau` holds torques, unless `to_python` says that Python must."""
    m = t.memory
    t.to_python[0] = 0
    if not m.swinging[0]:
        if must_step(t):
            begin_step(t, False)
        elif m.steps[0] == 0:
            if t.place_kernel == 0:
                t.to_python[0] = 1
                return
            call(t.place_kernel, t.place)
            copy(t.place.problem.workspace.tau, t.tau)
            t.failures[0] = t.place.memory.failures[0]
            return
        elif wants_home(t):
            begin_step(t, True)
    copy_targets(t)
    if m.swinging[0] and has_landed(t):
        m.swinging[0], m.clock[0], m.corners[0] = 0, 0.0, 0
        come_home(t.home)
    if not m.swinging[0] and t.home.gentle[0]:
        foot = lost_foot(t)
        if foot >= 0:
            lower_again(t, foot)
    if m.swinging[0]:
        swing_tick(t)
    else:
        stand_tick(t)
    t.failures[0] = t.place.memory.failures[0] + t.both.memory.failures[0]
