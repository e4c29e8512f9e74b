"""Where a motion with steps is now: its planted soles, its place in the world, the CoP it needs."""

import numpy as np

from poise.baselines.balance.references.footing import COM, LIGHT, PLACE, SPIN, TURN
from poise.baselines.balance.references.splines import evaluate
from poise.baselines.balance.stepping.planning.cop_region import (
    double_support_region,
    single_support_region,
)
from poise.baselines.balance.stepping.planning.recentring import set_level_frame
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import find_nearest
from poise.envs.compiled.maths.vectors import along, turned

from .blocks import PerformTick


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
    """The motion's CoM, root and soles, into `samples`, in the motion's frame."""
    p = t.performance
    evaluate(p.knots, p.coeffs, False, time, p.samples[0], p.samples[1], p.samples[2])
    if p.pace.waits:
        rate, change = p.pace.rate, p.pace.change
        for j in range(p.samples.shape[1]):
            p.samples[2, j] = rate * rate * p.samples[2, j] + change * p.samples[1, j]
            p.samples[1, j] *= rate


@compiled
def put_frame(t: PerformTick) -> None:
    """Let the motion's frame be where its soles are as the robot's are now."""
    s, p = t.own.state, t.performance
    feet, place = s.sole_point, p.samples[0]
    yaw = heading_of(t)
    p.cos, p.sin = turned(s.heading[0], s.heading[1], np.cos(yaw), -np.sin(yaw))
    x = 0.5 * (place[PLACE[0]] + place[PLACE[1]])
    y = 0.5 * (place[PLACE[0] + 1] + place[PLACE[1] + 1])
    x, y = turned(p.cos, p.sin, x, y)
    p.x = 0.5 * (feet[0, 0] + feet[1, 0]) - x
    p.y = 0.5 * (feet[0, 1] + feet[1, 1]) - y
    p.floor = 0.5 * (feet[0, 2] + feet[1, 2])
    set_level_frame(t.own.memory.level_frame, s.heading[0], s.heading[1])


@compiled
def heading_of(t: PerformTick) -> float:
    """The mean heading of the motion's soles, of both or of the one that bears [rad]."""
    m, turns = t.own.memory, t.performance.samples[0]
    if m.swinging:
        return turns[TURN[1 - m.foot] + 2]
    return 0.5 * (turns[TURN[0] + 2] + turns[TURN[1] + 2])


@compiled
def face(t: PerformTick) -> None:
    """Let the level frame be along the motion's soles that bear."""
    p, yaw = t.performance, heading_of(t)
    x, y = turned(p.cos, p.sin, np.cos(yaw), np.sin(yaw))
    set_level_frame(t.own.memory.level_frame, x, y)


@compiled
def turn_to_world(t: PerformTick) -> None:
    """Turn CoM and places of `samples` to the world."""
    p = t.performance
    for column in (COM, PLACE[0], PLACE[1], SPIN):
        for r in range(3):
            x, y = p.samples[r, column], p.samples[r, column + 1]
            x, y = turned(p.cos, p.sin, x, y)
            p.samples[r, column], p.samples[r, column + 1] = x, y
        if column != SPIN:
            p.samples[0, column] += p.x
            p.samples[0, column + 1] += p.y
            p.samples[0, column + 2] += p.floor


@compiled
def stance_differs(t: PerformTick) -> bool:
    """Return whether the feet stand otherwise to each other than the motion's do now."""
    s, p = t.own.state, t.performance
    feet, place = s.sole_point, p.samples[0]
    x, y = along(
        s.heading[0], s.heading[1], feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    )  # fmt: skip
    yaw = heading_of(t)
    u, v = along(
        np.cos(yaw), np.sin(yaw), place[PLACE[0]] - place[PLACE[1]],
        place[PLACE[0] + 1] - place[PLACE[1] + 1],
    )  # fmt: skip
    x, y = x - u, y - v
    return np.sqrt(x * x + y * y) > p.stance_error


@compiled
def squared_rate(t: PerformTick) -> float:
    """ω² = (g + c̈_z)/(c_z − ground) of the motion [1/s²]; of 0.7 g at least."""
    p = t.performance
    height = p.samples[0, COM + 2] - p.floor
    gravity = t.own.robot.gravity
    return max(gravity + p.samples[2, COM + 2], LIGHT * gravity) / max(height, 1e-3)


@compiled
def wanted_cop(t: PerformTick, gain: float, out: np.ndarray) -> None:
    """p_ref + (1 + gain) (ξ − ξ_ref) into `out` (≥ 2,) [m]; p_ref = c − c̈/ω² − δ is the ZMP."""
    s, samples = t.own.state, t.performance.samples
    rate = squared_rate(t)
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
