"""The way of a swing foot: C² from wherever it is to a foothold that may move on the way."""

from dataclasses import dataclass, field

import numpy as np

from poise.baselines.whole_body.tasks.sole_pose import SolePose, SolePoseBlock, SolePoseGains
from poise.baselines.whole_body.tasks.task import BoundTask
from poise.envs.compiled.block import Block
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.maths.pendulum import Units
from poise.envs.physics.arrays import RobotArrays

LANDING = 0.6  # share of a swing after which contact is touchdown, not the lift-off
FROZEN = 0.03  # [s] before touchdown the foothold no longer moves


@dataclass(frozen=True)
class SwingTask:
    """J_swing v̇ + J̇ v = a_ref + k (x_ref ⊖ x) + d (ẋ_ref − ẋ), k = `stiffness`, d = 2 ζ √k.

    Units as in `whole_body/gains.py`: weights per g² and (g/h)², a stiffness of 1 is ω²,
    lengths in h.
    """

    weight: float = field(default=1000.0, metadata={"above": 0.0})
    turn_weight: float = field(default=100.0, metadata={"above": 0.0})
    yaw_share: float = field(default=1.0, metadata={"min": 0.0})  # of it, about the vertical
    stiffness: float = field(default=60.0, metadata={"min": 0.0})
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})
    clearance: float = field(default=0.06, metadata={"above": 0.0, "max": 0.5})  # [h]
    lift: float = field(default=0.45, metadata={"above": 0.0, "max": 0.9})  # share of the time
    landing_speed: float = field(default=0.1, metadata={"min": 0.0})  # downwards [h ω]


@compiled
def quintic(p0, v0, a0, p1, v1, a1, duration, t):
    """Position, velocity, acceleration at `t` of the polynomial of degree five that leads from
    (p0, v0, a0) to (p1, v1, a1) in `duration`: the way of least jerk [Flash85]."""
    T = max(duration, 1e-6)
    v0, a0, v1, a1 = v0 * T, a0 * T * T, v1 * T, a1 * T * T
    d = p1 - p0
    c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * d - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    s = min(max(t / T, 0.0), 1.0)
    position = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    velocity = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    acceleration = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    return position, velocity / T, acceleration / (T * T)


@dataclass(frozen=True, eq=False)
class SwingArrays(Block):
    """A `Swing` as compiled code reads and writes it."""

    reference: np.ndarray  # (3, 3) position, velocity, acceleration [m, s]
    foothold: np.ndarray  # (2,)
    time: np.ndarray  # (1,) since it began [s]
    duration: np.ndarray  # (1,)
    ground: np.ndarray  # (1,) height of the ground [m]
    shift: np.ndarray  # (1,) of the duration, by a policy [s]
    apex: float  # above the ground [m]
    lift: float  # share of the time
    landing_speed: float  # [m/s]


@compiled
def start_swing(w: SwingArrays, point: np.ndarray, ground: float, duration: float):
    """At rest at `point` (3,)."""
    for a in range(3):
        w.reference[0, a], w.reference[1, a], w.reference[2, a] = point[a], 0.0, 0.0
    w.foothold[0], w.foothold[1] = point[0], point[1]
    w.time[0], w.duration[0], w.ground[0], w.shift[0] = 0.0, duration, ground, 0.0


@compiled
def time_left(w: SwingArrays) -> float:
    """Until touchdown is planned [s]."""
    return max(w.duration[0] - w.time[0], 0.0)


@compiled
def aim_swing(w: SwingArrays, x: float, y: float, duration: float):
    """Lead to another foothold, or at another time, but for the last `FROZEN` seconds."""
    if time_left(w) > FROZEN:
        w.foothold[0], w.foothold[1] = x, y
        w.duration[0] = max(duration, w.time[0] + FROZEN)


@compiled
def _lead(reference, a, position, velocity, duration, dt):
    """Axis `a` of the reference, `dt` further on its way to a place and a speed."""
    reference[0, a], reference[1, a], reference[2, a] = quintic(
        reference[0, a], reference[1, a], reference[2, a], position, velocity, 0.0, duration, dt
    )


@compiled
def advance_swing(w: SwingArrays, dt: float):
    """`dt` [s] further: up to the apex, down to the ground, on at the landing speed."""
    rest, now, ground, speed = time_left(w), w.reference, w.ground[0], w.landing_speed
    for a in range(2):
        if rest > dt:
            _lead(now, a, w.foothold[a], 0.0, rest, dt)
        else:
            now[0, a], now[1, a], now[2, a] = w.foothold[a], 0.0, 0.0
    lift = w.lift * w.duration[0]
    if w.time[0] + dt < lift:
        _lead(now, 2, ground + w.apex, 0.0, lift - w.time[0], dt)
    elif rest > dt:
        _lead(now, 2, ground, -speed, rest, dt)
    else:
        now[0, 2], now[1, 2], now[2, 2] = now[0, 2] - speed * dt, -speed, 0.0
    w.time[0] += dt


class Swing(Copyable):
    """Reference of one swing foot, planned anew each tick from its own last value: C² always.

    Vertically it rises to the clearance in `lift` of the time, then comes down and, where the
    ground is late, on at the landing speed.
    """

    FROZEN = FROZEN

    def __init__(self, point: np.ndarray, duration: float, task: SwingTask, units: Units):
        height = units.height
        speed = task.landing_speed * height * units.omega
        self.task = task
        self.arrays = SwingArrays(
            apart((3, 3)), apart(2), apart(1), apart(1), apart(1), apart(1),
            task.clearance * height, task.lift, float(speed),
        )  # fmt: skip
        start_swing(self.arrays, np.array(point, dtype=float), float(point[2]), float(duration))

    @property
    def reference(self) -> np.ndarray:
        """(3, 3) position, velocity and acceleration [m, s]."""
        return self.arrays.reference

    @property
    def foothold(self) -> np.ndarray:
        """(2,) where it is to land [m]."""
        return self.arrays.foothold

    @property
    def time(self) -> float:
        """Since it began [s]."""
        return float(self.arrays.time[0])

    @property
    def duration(self) -> float:
        """From lift-off to touchdown [s]."""
        return float(self.arrays.duration[0])

    @property
    def landing_speed(self) -> float:
        """[m/s]."""
        return self.arrays.landing_speed

    @property
    def remaining(self) -> float:
        """Seconds until touchdown is planned."""
        return time_left(self.arrays)

    def aim(self, foothold: np.ndarray, duration: float | None = None) -> None:
        """Lead to another `foothold` (2,), or at another time, see `aim_swing`."""
        duration = self.duration if duration is None else duration
        aim_swing(self.arrays, float(foothold[0]), float(foothold[1]), float(duration))

    def advance(self, dt: float) -> np.ndarray:
        """(3, 3) position, velocity and acceleration [m, s] after `dt` more seconds."""
        advance_swing(self.arrays, dt)
        return self.reference.copy()


def swing_gains(robot: RobotArrays, task: SwingTask) -> SolePoseGains:
    """`task` for one robot."""
    g, rate2 = robot.gravity, robot.gravity / robot.height_com
    k = task.stiffness * rate2
    d = 2.0 * task.damping_ratio * np.sqrt(k)
    turn = task.turn_weight / rate2**2
    return SolePoseGains(
        stiffness=float(k), damping=float(d), weight=float(task.weight / g**2),
        turn_weight=float(turn), yaw_weight=float(task.yaw_share * turn), error=apart(3),
    )  # fmt: skip


def swing_task(
    sole: int, reference: np.ndarray, axes: np.ndarray, gains: SolePoseGains
) -> BoundTask:
    """The task of the QP that moves a sole along `reference` (3, 3), its `axes` (3, 3) fixed."""
    return BoundTask(SolePose(), SolePoseBlock(sole, reference, axes, gains))
