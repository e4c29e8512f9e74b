"""How fast a motion's time runs: it may wait while the robot catches itself."""

from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.kinematics import StateArrays

AFTER = ("resume", "catch-up", "restart")
CATCH_UP, RESTART = 1, 2
CALM = 0.8  # β above which the robot counts as recovered
HELD = 0.5  # β below which the motion restarts, with `restart`


@dataclass(frozen=True)
class Tempo:
    """The rate ṡ of a motion's time s: it follows β by a lag, with `waits`; else it is 1.

        β = exp(−(|c − c_ref|/d)²), horizontally,    τ s̈ = max(β, least) − ṡ

    During a swing `least` is 0. After that the motion goes on from where it is
    (`resume`), runs up to `fastest` times as fast until it is on time (`catch-up`), or goes back to
    its begin first, if β fell below one half (`restart`).

    Attributes:
        waits: Whether the motion's time slows while the robot catches itself.
        distance: Distance d of the CoM from its reference at which the motion slows, over the
            standing height.
        lag: Time constant τ with which the rate of the motion follows [s].
        least: Least rate of the motion while both feet stand.
        after: What follows a wait: continue (resume), run until on time (catch-up), or begin again
            (restart).
        fastest: Largest rate of the motion while it catches up.
    """

    waits: bool = False
    distance: float = field(default=0.02, metadata={"above": 0.0})
    lag: float = field(default=0.1, metadata={"above": 0.0})
    least: float = field(default=0.1, metadata={"min": 0.0, "max": 1.0})
    after: Literal["resume", "catch-up", "restart"] = "catch-up"
    fastest: float = field(default=1.25, metadata={"min": 1.0, "max": 10.0})


@dataclass(eq=False)
class Pace(Block):
    """A tempo as compiled code reads it, and the state of the motion."""

    waits: bool
    distance: float  # [m]
    lag: float  # [s]
    least: float
    after: int  # index of `AFTER`
    fastest: float
    time: Mutable[float]  # of the motion [s]
    rate: Mutable[float]  # ṡ
    change: Mutable[float]  # s̈ [1/s]
    clock: Mutable[float]  # of the last tick [s]
    back: Mutable[int]  # 1 while it goes back

    def clear(self) -> None:
        """Begin the motion."""
        super().clear()
        self.rate = 1.0


def make_pace(tempo: Tempo, height: float) -> Pace:
    """The pace of a motion that has not begun; `height` [m] is h."""
    own = {"distance": tempo.distance * height, "after": AFTER.index(tempo.after)}
    pace = Pace.allocate(**(asdict(tempo) | own))
    pace.clear()
    return pace


@compiled
def motion_time_of(p: Pace, s: StateArrays, com_ref: np.ndarray, begin: float, now: float) -> float:
    """The motion's time [s] at `now` [s] after the reset, as its time runs since the last call.

    `com_ref` (3,) is where the CoM was to be then [m], `begin` [s] the motion's first time.
    """
    dt = now - p.clock
    if not p.waits or dt <= 0.0:
        return now if not p.waits else p.time
    rate = p.rate + min(dt / p.lag, 1.0) * (_wanted(p, s, com_ref, begin) - p.rate)
    p.clock = now
    p.change = (rate - p.rate) / dt
    p.rate = rate
    p.time = max(p.time + rate * dt, begin)
    return p.time


@compiled
def _wanted(p: Pace, s: StateArrays, com_ref: np.ndarray, begin: float) -> float:
    """The rate that is aimed at."""
    late = p.clock - p.time
    x, y = s.com[0] - com_ref[0], s.com[1] - com_ref[1]
    beta, least = np.exp(-(x * x + y * y) / (p.distance * p.distance)), p.least
    for i in range(s.contacts.shape[0]):
        if s.contacts[i] < 0.5:
            least = 0.0
    if beta > CALM and p.after == CATCH_UP and late > 0.0:
        return min(p.fastest, 1.0 + late)
    if p.after == RESTART:
        if p.time <= begin:
            p.back = 0
        elif beta < HELD:
            p.back = 1
        if p.back and beta > CALM:
            return -1.0
    return max(beta, least)


@compiled
def slow_down(p: Pace, samples: np.ndarray) -> None:
    """Velocities and accelerations of a motion (3, n) by its time as those by the clock."""
    if not p.waits:
        return
    rate, change = p.rate, p.change
    for j in range(samples.shape[1]):
        samples[2, j] = rate * rate * samples[2, j] + change * samples[1, j]
        samples[1, j] *= rate
