"""The way of a swing foot: C² from wherever it is to a foothold that may move on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from poise.envs.state import RobotState

from .task_rows import Rows

GRAVITY = 9.81  # [m/s²] of the landing speed's unit


@dataclass(frozen=True)
class SwingTask:
    """J_swing v̇ + J̇ v = a_ref + k (x_ref ⊖ x) + d (ẋ_ref − ẋ), k = `stiffness`, d = 2 ζ √k.

    Units as in `tasks.py`: weights per g² and (g/h)², a stiffness of 1 is ω², lengths in h.
    """

    weight: float = field(default=1000.0, metadata={"above": 0.0})
    turn_weight: float = field(default=100.0, metadata={"above": 0.0})
    stiffness: float = field(default=60.0, metadata={"min": 0.0})
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})
    clearance: float = field(default=0.06, metadata={"above": 0.0, "max": 0.5})  # [h]
    lift: float = field(default=0.45, metadata={"above": 0.0, "max": 0.9})  # share of the time
    landing_speed: float = field(default=0.1, metadata={"min": 0.0})  # downwards [h ω]


def quintic(start: Sequence, end: Sequence, duration: float, t: float) -> tuple[Any, Any, Any]:
    """Position, velocity, acceleration at `t` of the polynomial of degree five that leads from
    `start` to `end` (each the three of them) in `duration`: the way of least jerk [Flash85]."""
    T = max(duration, 1e-6)
    p0, v0, a0 = start[0], start[1] * T, start[2] * T * T
    p1, v1, a1 = end[0], end[1] * T, end[2] * T * T
    d = p1 - p0
    c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * d - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    s = min(max(t / T, 0.0), 1.0)
    position = p0 + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    velocity = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    acceleration = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    return position, velocity / T, acceleration / (T * T)


class Swing:
    """Reference of one swing foot, planned anew each tick from its own last value: C² always.

    Vertically it rises to the clearance in `lift` of the time, then comes down and, where the
    ground is late, on at the landing speed.
    """

    FROZEN = 0.03  # [s] before touchdown the foothold no longer moves

    def __init__(self, point: np.ndarray, duration: float, task: SwingTask, height: float):
        omega = np.sqrt(GRAVITY / height)
        self.task, self.duration, self.time = task, duration, 0.0
        self.apex = task.clearance * height
        self.ground = float(point[2])
        self.landing_speed = task.landing_speed * height * omega
        self.reference = np.zeros((3, 3))  # position, velocity, acceleration
        self.reference[0] = point
        self.foothold = np.array(point[:2])
        self.shift = 0.0  # of the duration, by a policy [s]

    @property
    def remaining(self) -> float:
        """Seconds until touchdown is planned."""
        return max(self.duration - self.time, 0.0)

    def aim(self, foothold: np.ndarray, duration: float | None = None) -> None:
        """Lead to another `foothold` (2,), or at another time."""
        if self.remaining > self.FROZEN:
            self.foothold = np.array(foothold, dtype=float)
            if duration is not None:
                self.duration = max(duration, self.time + self.FROZEN)

    def advance(self, dt: float) -> np.ndarray:
        """(3, 3) position, velocity and acceleration [m, s] after `dt` more seconds."""
        rest, speed = self.remaining, self.landing_speed
        x, y, z = zip(*self.reference.tolist(), strict=True)  # numbers: faster than small arrays
        aim = [(float(self.foothold[0]), 0.0, 0.0), (float(self.foothold[1]), 0.0, 0.0)]
        if rest > dt:
            ways = [quintic(now, end, rest, dt) for now, end in zip((x, y), aim, strict=True)]
        else:
            ways = aim
        lift = self.task.lift * self.duration
        if self.time + dt < lift:
            ways.append(quintic(z, (self.ground + self.apex, 0.0, 0.0), lift - self.time, dt))
        elif rest > dt:
            ways.append(quintic(z, (self.ground, -speed, 0.0), rest, dt))
        else:
            ways.append((z[0] - speed * dt, -speed, 0.0))
        self.reference, self.time = np.array(ways).T.copy(), self.time + dt
        return self.reference


def rotation_error(axes: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(3,) ½ Σ aᵢ × bᵢ of the columns of two frames: sine times axis of the turn from one to the
    other."""
    S = wanted @ axes.T
    return 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])


def swing_rows(
    state: RobotState, sole: int, reference: np.ndarray, axes: np.ndarray, task: SwingTask
) -> Rows:
    """Rows (6, nv) in v̇ of one sole's SE(3) task: `reference` (3, 3), sole `axes` (3, 3)."""
    h, g = state.robot.height_com, state.robot.gravity
    rate2 = g / h
    k = task.stiffness * rate2
    d = 2.0 * task.damping_ratio * np.sqrt(k)
    rows = slice(6 * sole, 6 * sole + 6)
    J, velocity, bias = state.J[rows], state.J_v[rows], state.Jdot_v[rows]
    turn = rotation_error(state.sole_axes[sole], axes)
    wanted = np.concatenate(
        [
            reference[2]
            + k * (reference[0] - state.sole_points[sole])
            + d * (reference[1] - velocity[:3]),
            k * turn - d * velocity[3:],
        ]
    )
    weights = np.empty(6)
    weights[:3], weights[3:] = task.weight / g**2, task.turn_weight / rate2**2
    return Rows(J, wanted - bias, weights)
