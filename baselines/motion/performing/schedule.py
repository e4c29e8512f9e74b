"""Where a motion with steps is now: its planted soles, its place in the world, the CoP it needs."""

import numpy as np

from poise.baselines.balance.references.footing import LIGHT, name_columns
from poise.baselines.balance.references.splines import evaluate
from poise.baselines.balance.stepping.planning.cop_region import (
    double_support_region,
    single_support_region,
)
from poise.baselines.balance.stepping.planning.recentring import set_level_frame
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import along, turned

from .blocks import Performance, PerformTick


@compiled
def motion_time(t: PerformTick) -> float:
    """The motion's own time [s]."""
    p = t.performance
    return p.pace.time if p.pace.waits else p.clock


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
    """Return the swing foot of a phase; −1: none."""
    planted = t.performance.planted
    for foot in range(2):
        if planted[phase, foot] == 0:
            return foot
    return -1


@compiled
def flies(t: PerformTick, phase: int) -> bool:
    """Return whether neither sole is planted in a phase."""
    planted = t.performance.planted
    return planted[phase, 0] == 0 and planted[phase, 1] == 0


@compiled
def sample_footing(t: PerformTick, time: float) -> None:
    """The motion's CoM, root and soles, in the motion's frame."""
    p = t.performance
    evaluate(p.knots, p.coeffs, False, time, p.rows[0], p.rows[1], p.rows[2])
    if p.pace.waits:
        rate, change = p.pace.rate, p.pace.change
        for j in range(p.rows.shape[1]):
            p.rows[2, j] = rate * rate * p.rows[2, j] + change * p.rows[1, j]
            p.rows[1, j] *= rate
    name_columns(p.rows, p.com, p.root, p.places, p.turns, p.momentum_offset)


@compiled
def put_frame(t: PerformTick) -> None:
    """Let the motion's frame be where its soles are as the robot's are now."""
    s, p = t.own.state, t.performance
    feet, left, right = s.sole_point, p.places[0, 0], p.places[1, 0]
    yaw = heading_of(t)
    p.cos, p.sin = turned(s.heading[0], s.heading[1], np.cos(yaw), -np.sin(yaw))
    x, y = 0.5 * (left[0] + right[0]), 0.5 * (left[1] + right[1])
    x, y = turned(p.cos, p.sin, x, y)
    p.x = 0.5 * (feet[0, 0] + feet[1, 0]) - x
    p.y = 0.5 * (feet[0, 1] + feet[1, 1]) - y
    p.floor = 0.5 * (feet[0, 2] + feet[1, 2])
    set_level_frame(t.own.memory.level_frame, s.heading[0], s.heading[1])


@compiled
def heading_of(t: PerformTick) -> float:
    """The mean heading of the motion's soles, of both or of the one that bears [rad]."""
    m, turns = t.own.memory, t.performance.turns
    if m.swinging:
        return turns[1 - m.foot, 0, 2]
    return 0.5 * (turns[0, 0, 2] + turns[1, 0, 2])


@compiled
def face(t: PerformTick) -> None:
    """Let the level frame be along the motion's soles that bear."""
    p, yaw = t.performance, heading_of(t)
    x, y = turned(p.cos, p.sin, np.cos(yaw), np.sin(yaw))
    set_level_frame(t.own.memory.level_frame, x, y)


@compiled
def turn_to_world(t: PerformTick) -> None:
    """Turn CoM, places and δ to the world, and move CoM and places there."""
    p = t.performance
    for rows in (p.com, p.places[0], p.places[1]):
        turn_rows(p, rows)
        rows[0, 0] += p.x
        rows[0, 1] += p.y
        rows[0, 2] += p.floor
    turn_rows(p, p.momentum_offset)


@compiled
def turn_rows(p: Performance, rows: np.ndarray) -> None:
    """Turn vectors (3, ≥ 2) from the motion's frame to the world's axes."""
    for r in range(3):
        x, y = rows[r, 0], rows[r, 1]
        rows[r, 0], rows[r, 1] = turned(p.cos, p.sin, x, y)


@compiled
def stance_differs(t: PerformTick) -> bool:
    """Return whether the feet stand otherwise to each other than the motion's do now."""
    s, p = t.own.state, t.performance
    feet, left, right = s.sole_point, p.places[0, 0], p.places[1, 0]
    x, y = along(
        s.heading[0], s.heading[1], feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    )  # fmt: skip
    yaw = heading_of(t)
    u, v = along(np.cos(yaw), np.sin(yaw), left[0] - right[0], left[1] - right[1])
    x, y = x - u, y - v
    return np.sqrt(x * x + y * y) > p.stance_error


@compiled
def squared_rate(t: PerformTick) -> float:
    """ω² = (g + c̈_z)/(c_z − ground) of the motion [1/s²]; of 0.7 g at least."""
    p = t.performance
    height = p.com[0, 2] - p.floor
    gravity = t.own.robot.gravity
    return max(gravity + p.com[2, 2], LIGHT * gravity) / max(height, 1e-3)


@compiled
def wanted_cop(t: PerformTick, gain: float, out: np.ndarray) -> None:
    """p_ref + (1 + gain) (ξ − ξ_ref) into `out` (≥ 2,) [m]; p_ref = c − c̈/ω² − δ is the ZMP."""
    s, p = t.own.state, t.performance
    rate = squared_rate(t)
    omega = np.sqrt(rate)
    for a in range(2):
        error = s.com[a] - p.com[0, a] + (s.com_vel[a] - p.com[1, a]) / omega
        zmp = p.com[0, a] - p.com[2, a] / rate - p.momentum_offset[0, a]
        out[a] = zmp + (1.0 + gain) * error


@compiled
def reached_region(t: PerformTick) -> int:
    """The corners of what the soles in contact reach, into `memory.region`; how many they are."""
    c, m = t.own, t.own.memory
    feet, level, region = c.state.sole_point, m.level_frame, t.own.search.region
    cos, sin = level[0, 0], level[1, 0]
    if m.swinging:
        stance = 1 - m.foot
        return single_support_region(region, stance, feet[stance], cos, sin, m.region)
    return double_support_region(region, feet, cos, sin, c.cloud, m.region)


@compiled
def beyond_reach(t: PerformTick, corners: int) -> float:
    """How much further outside what soles reach the least CoP that keeps ξ − ξ_ref from growing is
    than the motion's own ZMP [m]: what a motion asks for itself for a moment is no fall."""
    return _outside(t, corners, 0.0) - _outside(t, corners, -1.0)


@compiled
def _outside(t: PerformTick, corners: int, gain: float) -> float:
    """How far `wanted_cop` is outside what soles reach [m]."""
    c = t.own
    wanted_cop(t, gain, c.vector)
    find_nearest(c.memory.region[:corners], c.vector, c.pair)
    x, y = c.vector[0] - c.pair[0], c.vector[1] - c.pair[1]
    return np.sqrt(x * x + y * y)
