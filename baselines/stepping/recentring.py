"""Back to the stance of standing: what a stepping controller does once it has come to rest.

Steps end wherever they caught the fall, one foot ahead or both wide apart, and the next push meets
that stance. So when all is calm the weight goes to one foot, and the other one goes home: as near
to where it stands at rest as it can with ξ between the feet at touchdown. Kernels on a
`CaptureTick`.
"""

from dataclasses import dataclass, field

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import call
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.robots.robot import Robot

from .reach import standing_feet
from .search import (
    Search,
    drift,
    left_outside,
    put_foothold,
    see_fall,
    start_from,
    take_foot,
    to_local,
    turned,
)
from .swing import FROZEN, LANDING, SwingArrays, start_swing, time_left

# stages: nobody goes home; the weight goes to one foot; the other swings; it takes up its load
AWAY, LEANING, SWINGING, PRESSING = range(4)
TRIED = 8  # footholds between home and the one that a planner would choose
BOUNCE = 0.06  # [s] after touchdown in which a foot may leave the ground
LOST, SLIP = 0.04, 0.25  # a foot that has been off the ground [s], or slid so fast [m/s], is lost


@dataclass(frozen=True)
class StepHome:
    """When and how feet go home; lengths in h, times in 1/ω.

    Attributes:
        far: a foot this far from where it stands at rest beside the other one goes home; 0: never.
        calm, tilt: CoM speed [h ω] and tilt of the root [°] below which the robot is calm.
        after: time that it must be.
        lean: how far from the middle of the stance sole's reach, towards where the other foot goes,
            ξ is brought before that lifts off.
        counter: share of the other foot's way that ξ is brought against it besides, since the leg
            that swings takes ξ along.
        near: ξ is there.
        patience: time after which the foot lifts off wherever ξ is.
        time: from lift-off to touchdown.
        margin: how far inside the reach of both soles ξ is to be at touchdown.
        press: most that the CoP is away from ξ after it, so that the foot which came home is not
            relieved again.
    """

    far: float = field(default=0.0, metadata={"min": 0.0})
    calm: float = field(default=0.1, metadata={"min": 0.0})
    tilt: float = field(default=35.0, metadata={"above": 0.0, "max": 180.0})
    after: float = field(default=0.5, metadata={"min": 0.0})
    lean: float = field(default=0.025, metadata={"min": 0.0})
    counter: float = field(default=0.07, metadata={"min": 0.0})
    near: float = field(default=0.02, metadata={"above": 0.0})
    patience: float = field(default=3.0, metadata={"min": 0.0})
    time: float = field(default=1.0, metadata={"above": 0.0})
    margin: float = 0.015
    press: float = field(default=0.05, metadata={"min": 0.0})


@dataclass(frozen=True, eq=False)
class HomeArrays(Block):
    """A `StepHome` in m and s, and how far it is."""

    far: float
    calm: float
    upright: float  # cosine of `tilt`
    after: float
    lean: float
    counter: float
    near: float
    patience: float
    time: float
    margin: float
    press: float
    standing: np.ndarray  # (2,) from the second sole to the first one at rest, along the heading
    stage: np.ndarray  # (1,) int: AWAY to PRESSING
    foot: np.ndarray  # (1,) int: that goes home
    gentle: np.ndarray  # (1,) int: 1 from lift-off on the way home until a fall begins
    lost: np.ndarray  # (2,) for how long each foot that came home has been off the ground [s]
    waited: np.ndarray  # (1,) calm so far; then since the weight goes to one foot [s]
    rest: np.ndarray  # (2,) where ξ is brought


def home_arrays(robot: Robot, home: StepHome) -> HomeArrays:
    """`home` for one robot."""
    c, h, rate = home, robot.height_com, robot.omega
    feet = standing_feet(robot)
    return HomeArrays(
        c.far * h, c.calm * h * rate, float(np.cos(np.radians(c.tilt))), c.after / rate,
        c.lean * h, c.counter, c.near * h, c.patience / rate, c.time / rate, c.margin * h,
        c.press * h,
        (feet[0] - feet[1])[:2].copy(), apart(1, dtype=np.int64), apart(1, dtype=np.int64),
        apart(1, dtype=np.int64), apart(2), apart(1), apart(2),
    )  # fmt: skip


@compiled
def leave_home(m: HomeArrays):
    """Nobody goes home."""
    m.stage[0], m.gentle[0], m.waited[0] = AWAY, 0, 0.0


@compiled
def face(level: np.ndarray, x: float, y: float):
    """Axes (3, 3) of a level sole that points along (x, y)."""
    yaw = np.arctan2(y, x)
    level[0, 0] = level[1, 1] = np.cos(yaw)
    level[1, 0] = np.sin(yaw)
    level[0, 1] = -level[1, 0]


@compiled
def _away(t) -> float:
    """How far the feet are from their stance at rest [m]."""
    feet, cos, sin = t.state.sole_point, t.memory.level[0, 0], t.memory.level[1, 0]
    x, y = feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1]
    x, y = cos * x + sin * y - t.home.standing[0], cos * y - sin * x - t.home.standing[1]
    return np.sqrt(x * x + y * y)


@compiled
def choose_foot(t):
    """The foot that is further from ξ goes home; ξ is brought near the other one before, and the
    way that this one points is ahead from now on."""
    s, m, feet = t.state, t.home, t.state.sole_point
    distances = t.pair
    for i in range(2):
        x, y = s.capture_point[0] - feet[i, 0], s.capture_point[1] - feet[i, 1]
        distances[i] = np.sqrt(x * x + y * y)
    foot = 1 if distances[0] < distances[1] else 0
    m.stage[0], m.foot[0], m.waited[0] = LEANING, foot, 0.0
    t.memory.again[0] = 1
    axes, level = s.sole_axes[1 - foot], t.memory.level
    face(level, axes[0, 0], axes[1, 0])
    t.memory.corners[0] = 0
    q, side = t.search, 1.0 if foot == 0 else -1.0
    q.foot[0], q.heading[0], q.heading[1] = foot, level[0, 0], level[1, 0]
    x, y = to_local(q, feet[foot, 0], feet[foot, 1])
    home_x, home_y = side * m.standing[0], side * m.standing[1]
    share = m.lean / np.sqrt(home_x * home_x + home_y * home_y)
    rest_x = q.reach.middle[1 - foot, 0] + share * home_x + m.counter * (x - home_x)
    rest_y = q.reach.middle[1 - foot, 1] + share * home_y + m.counter * (y - home_y)
    put_foothold(q, rest_x, rest_y)  # into the world
    m.rest[0], m.rest[1] = q.foothold[0], q.foothold[1]


@compiled
def _is_calm(t) -> bool:
    """Slow and upright."""
    s, m, up = t.state, t.home, 0.0
    for a in range(3):
        up += s.root_axes[2, a] * t.search.feedback.upright[a]
    speed = np.sqrt(s.com_vel[0] * s.com_vel[0] + s.com_vel[1] * s.com_vel[1])
    return speed < m.calm and up > m.upright


@compiled
def wants_home(t) -> bool:
    """On both feet after steps: whether one of them lifts off for home now. Counts how long it has
    been calm, and when it has been for long chooses the foot or begins anew."""
    s, m = t.state, t.home
    if m.far == 0.0:
        return False
    if m.stage[0] == LEANING:
        m.waited[0] += t.gains.period
        x, y = s.capture_point[0] - m.rest[0], s.capture_point[1] - m.rest[1]
        return np.sqrt(x * x + y * y) < m.near or m.waited[0] > m.patience
    m.waited[0] = m.waited[0] + t.gains.period if _is_calm(t) else 0.0
    if m.waited[0] > m.after:
        if _away(t) > m.far:
            choose_foot(t)
        else:
            t.memory.again[0] = 0  # as at the start: the next push meets a first step
    return False


@compiled
def press(t, rest_x: float, rest_y: float, p: np.ndarray):
    """`p` (≥ 2,) no further than `press` from ξ, until ξ has come to rest."""
    m, xi = t.home, t.state.capture_point
    x, y = xi[0] - rest_x, xi[1] - rest_y
    if np.sqrt(x * x + y * y) < m.near:
        m.stage[0] = AWAY
        return
    x, y = p[0] - xi[0], p[1] - xi[1]
    share = min(1.0, m.press / max(np.sqrt(x * x + y * y), 1e-9))
    p[0], p[1] = xi[0] + share * x, xi[1] + share * y


@compiled
def _foothold_home(q: Search, m: HomeArrays, time: float):
    """The foothold nearest home from which ξ(T) lies between the feet, into `best`."""
    foot, stance = q.foot[0], q.state.sole_point[1 - q.foot[0]]
    side = 1.0 if foot == 0 else -1.0
    x, y = turned(q, side * m.standing[0], side * m.standing[1])
    home_x, home_y = stance[0] + x, stance[1] + y
    q.time[0] = time
    call(q.law, q)
    catch_x, catch_y = q.foothold[0], q.foothold[1]
    end_x, end_y = drift(q)
    for k in range(TRIED + 1):
        share = k / TRIED
        x, y = home_x + share * (catch_x - home_x), home_y + share * (catch_y - home_y)
        q.foothold[0], q.foothold[1] = x, y
        outside = left_outside(q, end_x, end_y)
        if outside < -m.margin:
            break
    q.best[0], q.best[1], q.best[2], q.best[3], q.best[4] = x, y, time, outside, 0.0
    q.best_foot[0] = foot


@compiled
def plan_home(q: Search, m: HomeArrays):
    """The step of the foot that goes home."""
    see_fall(q)
    foot = m.foot[0]
    q.feedback.stage[1] = 0.0
    take_foot(q, foot)
    start_from(q, q.state.sole_point[foot, 0], q.state.sole_point[foot, 1])
    _foothold_home(q, m, m.time)
    m.stage[0], m.gentle[0] = SWINGING, 1


@compiled
def replan_home(q: Search, m: HomeArrays, w: SwingArrays) -> bool:
    """The same in its swing; False where ξ can no longer be caught near home."""
    q.feedback.stage[1] = w.time[0] / w.duration[0]
    take_foot(q, m.foot[0])
    start_from(q, w.reference[0, 0], w.reference[0, 1])
    _foothold_home(q, m, max(time_left(w), FROZEN))
    return q.best[3] <= 0.0


@compiled
def lost_foot(t) -> int:
    """The foot that should stand, after a step home, but is off the ground or slides; −1: none.

    It bears little at first, and a contact that is planned but not there drives it away.
    """
    s, m = t.state, t.home
    for foot in range(2):
        x, y = s.J_v[6 * foot], s.J_v[6 * foot + 1]
        gone = s.contacts[foot] < 0.5 or np.sqrt(x * x + y * y) > SLIP
        gone = gone and s.contacts[1 - foot] > 0.5 and t.memory.clock[0] > BOUNCE
        m.lost[foot] = m.lost[foot] + t.gains.period if gone else 0.0
        if m.lost[foot] > LOST:
            return foot
    return -1


@compiled
def lower_again(t, foot: int):
    """The second half of a swing for a foot that is lost, from where and as fast as it is."""
    s, m, w = t.state, t.memory, t.swing
    m.foot[0], m.swinging[0], m.left[0] = foot, 1, 0.0
    t.home.stage[0] = AWAY
    start_swing(w, s.sole_point[foot], s.sole_point[1 - foot, 2], t.search.time_min)
    for a in range(3):
        w.reference[1, a] = s.J_v[6 * foot + a]
    w.time[0] = max(w.lift, LANDING) * w.duration[0]


@compiled
def come_home(m: HomeArrays):
    """At touchdown: the foot that came home is to take up its load."""
    m.lost[0] = m.lost[1] = 0.0
    if m.stage[0] == SWINGING:
        m.stage[0] = PRESSING
