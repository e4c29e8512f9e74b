"""Steps on given footholds: each on a surface that holds the whole sole, at a time of its own.

The CoM goes parallel to the line through the feet, on which c̈ = ω² (c − p) holds along the ground
as on level ground [Kajita91]. Since a tread leaves little choice of the place, the time of
touchdown is chosen so that the foothold that the capture point asks for is on it.
"""

import numpy as np

from poise.baselines.balance.stepping.planning.swing import quintic, time_left
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import turned
from poise.envs.terrain.arrays import surface_below, surface_height

from .blocks import Treads, WalkTick

FREE = 1.0  # [m] a surface that is longer leaves footholds free: several steps fit on it
SIDE_BY_SIDE = 0.08  # [m] between feet that are not one behind the other
LEANING = 0.25  # [s] in which the trunk comes to lean
LEVEL = 0.02  # [m] between surfaces of one height
MOST_STEPS = 4  # before the first tread, in which the steps become as long as meets it
NOT_HELD = 1.0  # [m] cost of a foothold where no surface holds the sole
OTHER = 0.12  # [m] cost of another surface than the one that a step aims at
SLOW = 0.02  # [m/s]


@compiled
def footholds_given(t: WalkTick) -> bool:
    """Return whether steps are to be on treads."""
    return t.gait.treads.surfaces.shape[0] > 0


@compiled
def put_room(t: WalkTick, foot: int) -> None:
    """How far the sole reaches backward and forward along the treads, with the margin [m]."""
    c, r, level = t.walk, t.gait.treads, t.walk.memory.level_frame
    r.room[0] = r.room[1] = 0.0
    for k in range(c.robot.sole_vertices[foot]):
        corner = c.robot.sole_polygon[foot, k]
        x, _ = turned(level[0, 0], level[1, 0], corner[0], corner[1])
        r.room[0], r.room[1] = max(r.room[0], -x), max(r.room[1], x)
    r.room[0] += r.margin
    r.room[1] += r.margin


@compiled
def is_free(r: Treads, i: int) -> bool:
    """Return whether a surface leaves footholds free."""
    return r.surfaces[i].x_max - r.surfaces[i].x_min > FREE


@compiled
def settle_on_tread(t: WalkTick, foot: int) -> float:
    """Move the foothold that is weighed along x to the nearest surface that holds the sole; its
    height into `target`; by how much it was moved, and more if that is not the one aimed at [m]."""
    r, place = t.gait.treads, t.walk.search.foothold
    stance = t.walk.state.sole_point[1 - foot, 2]
    put_room(t, foot)
    nearest, moved, found = NOT_HELD, place[0], False
    for i in range(r.surfaces.shape[0]):
        low, high = r.surfaces[i].x_min + r.room[0], r.surfaces[i].x_max - r.room[1]
        x = min(max(place[0], low), high)
        z = surface_height(r.surfaces, i, 0.0, x)
        way = abs(x - place[0]) + (0.0 if i == r.aim else OTHER)
        if high < low or abs(z - stance) > r.highest or way >= nearest:
            continue
        nearest, moved, found = way, x, True
        r.target = z
    if not found:
        r.target = stance
    place[0] = moved
    return nearest


@compiled
def first_place(r: Treads, i: int) -> float:
    """Where a sole goes on surface `i` that comes from before it: its middle, or, of a long one,
    near its edge [m]."""
    if is_free(r, i):
        return r.surfaces[i].x_min + r.room[0] + r.margin
    return 0.5 * (r.surfaces[i].x_min + r.surfaces[i].x_max)


@compiled
def meet_treads(t: WalkTick, period: float) -> None:
    """Plan the velocity with which steps, one each `period` [s], meet the treads ahead.

    On both feet it also decides which surface the next step is to go to.
    """
    g, r, c = t.gait, t.gait.treads, t.walk
    foot, feet = c.memory.foot, c.state.sole_point
    stance = feet[1 - foot] if c.memory.swinging else feet[foot]
    i = surface_below(r.surfaces, stance[0], stance[1])
    g.error[0], g.planned[0] = 0.0, g.velocity[0]
    if not c.memory.swinging:
        r.aim = i
    if g.velocity[0] <= SLOW or i < 0 or i + 1 >= r.surfaces.shape[0]:
        return
    put_room(t, foot)
    way, steps = first_place(r, i + 1) - stance[0], 1.0
    if is_free(r, i):
        steps = max(np.rint(way / max(g.velocity[0] * period, r.least_step)), 1.0)
        steps = max(steps, np.ceil(way / r.approach))
    if not c.memory.swinging:
        r.aim = i + 1 if steps == 1.0 else i
    steps = 1.0 if r.aim > i else max(steps, 2.0)
    if steps <= MOST_STEPS:
        g.planned[0] = way / (steps * period)


@compiled
def rise_near(r: Treads, place: np.ndarray) -> float:
    """The highest of the edges up that a sole at `place` has just passed or is before [m]."""
    i, highest = surface_below(r.surfaces, place[0], place[1]), 0.0
    if i < 0:
        return highest
    for k in (i, i + 1):  # the edge between surfaces k − 1 and k
        if k < 1 or k >= r.surfaces.shape[0]:
            continue
        edge = r.surfaces[k].x_min
        if abs(edge - place[0]) > r.approach:
            continue
        before = surface_height(r.surfaces, k - 1, 0.0, edge)
        highest = max(highest, surface_height(r.surfaces, k, 0.0, edge) - before)
    return highest


@compiled
def lean_ahead(t: WalkTick) -> None:
    """Turn the trunk that is asked for ahead, by what the rise of the edges near the stance sole
    takes: a hip behind the CoM spares the knee of the leg ahead (docs/walking.md#terrain)."""
    c, r, own = t.walk, t.gait.treads, t.walk.reference_out
    foot = c.memory.foot
    stance = c.state.sole_point[1 - foot if c.memory.swinging else foot]
    asked = r.lean * max(rise_near(r, stance) - r.lean_from, 0.0)
    r.leaning += min(c.gains.period / LEANING, 1.0) * (asked - r.leaning)
    cos, sin, level = np.cos(r.leaning), np.sin(r.leaning), c.memory.level_frame
    for a in range(3):
        ahead = level[0, 0] * own.root_axes[0, a] + level[1, 0] * own.root_axes[1, a]
        up = own.root_axes[2, a]
        more = cos * ahead + sin * up - ahead
        own.root_axes[0, a] += level[0, 0] * more
        own.root_axes[1, a] += level[1, 0] * more
        own.root_axes[2, a] = cos * up - sin * ahead


@compiled
def feet_are_level(t: WalkTick) -> bool:
    """Return whether both feet are at one height."""
    feet = t.walk.state.sole_point
    return abs(feet[0, 2] - feet[1, 2]) < LEVEL


@compiled
def line_of_feet(t: WalkTick) -> tuple[float, float]:
    """Height [m] and gradient below the CoM of the line from a foot to the next one."""
    c, w, r = t.walk, t.walk.swing, t.gait.treads
    feet, x = c.state.sole_point, c.state.com[0]
    first = 1 - c.memory.foot if c.memory.swinging else 0
    x0, z0, x1, z1 = feet[first, 0], feet[first, 2], feet[1 - first, 0], feet[1 - first, 2]
    if c.memory.swinging:
        if x > x0:
            x1, z1 = w.foothold[0], w.ground
        else:
            x1, z1 = r.left[0], r.left[2]
    if abs(x1 - x0) < SIDE_BY_SIDE:
        return (z0 if c.memory.swinging else 0.5 * (z0 + z1)), 0.0
    gradient, low, high = (z1 - z0) / (x1 - x0), min(x0, x1), max(x0, x1)
    if x < low or x > high:
        return z0 + gradient * (min(max(x, low), high) - x0), 0.0
    return z0 + gradient * (x - x0), gradient


@compiled
def follow_line(t: WalkTick, height: float) -> None:
    """Ask for the CoM at a `height` [m] above the line of the feet, and parallel to it."""
    own = t.walk.reference_out
    ground, gradient = line_of_feet(t)
    own.com[2] = ground + height
    own.com_vel[2] = gradient * t.walk.state.com_vel[0]


@compiled
def _lead(t: WalkTick, a: int, place: float, speed: float, until: float) -> None:
    """Move axis `a` of the swing a tick further on its way to a place and a speed, there `until`
    [s] after lift-off."""
    w, dt = t.walk.swing, t.walk.gains.period
    now = w.reference
    now[0, a], now[1, a], now[2, a] = quintic(
        now[0, a], now[1, a], now[2, a], place, speed, 0.0, max(until - w.time, dt), dt
    )


@compiled
def apex_of_step(t: WalkTick) -> float:
    """How high a step on one surface lifts the sole [m]: as commanded, or the gait's own."""
    wanted = t.gait.commanded_clearance
    return wanted if wanted > 0.0 else t.walk.swing.apex


@compiled
def advance_over_edges(t: WalkTick) -> None:
    """Move the swing a tick further: up before it goes forward, and down when it is there."""
    w, r, dt = t.walk.swing, t.gait.treads, t.walk.gains.period
    after, whole, rest = w.time + dt, w.duration, time_left(w)
    start, end = r.left[2], w.ground
    between = t.walk.state.sole_point[1 - t.walk.memory.foot, 2]
    own = surface_below(r.surfaces, r.left[0], r.left[1])
    plain = own == surface_below(r.surfaces, w.foothold[0], w.foothold[1])
    down, arrive, apex = end < start - LEVEL, r.arrive * whole, max(start, end, between)
    hold = (r.hold_down if down else r.hold_up) * whole
    rise = (r.rise_down if down else r.rise) * whole
    lower = (r.lower_down if down else r.lower) * whole
    apex += max(r.clearance, t.gait.commanded_clearance)
    if plain:
        hold, arrive, rise, lower = 0.0, whole, w.lift * whole, w.lift * whole
        apex = end + apex_of_step(t)
    for a in range(2):
        if after < hold:
            _lead(t, a, r.left[a], 0.0, hold)
        elif after < arrive:
            _lead(t, a, w.foothold[a], 0.0, arrive)
        elif rest > dt:
            _lead(t, a, w.foothold[a], 0.0, whole)
        else:
            w.reference[0, a] = w.foothold[a]
            w.reference[1, a] = w.reference[2, a] = 0.0
    if after < lower:
        _lead(t, 2, apex, 0.0, rise if after < rise else lower)
    elif rest > dt:
        _lead(t, 2, end, -w.landing_speed, whole)
    else:
        w.reference[0, 2] -= w.landing_speed * dt
        w.reference[1, 2], w.reference[2, 2] = -w.landing_speed, 0.0
    w.time = after
