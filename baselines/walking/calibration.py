"""The command as a policy observes it: what it must be asked for so that the robot does as
commanded."""

from dataclasses import dataclass, field

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled

MOST_KNOTS = 32  # of an axis, both signs together
AXES = ("ahead", "left", "turn", "in_place", "aside")

Knots = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Calibration:
    """A policy observes f(c) in the place of a command c, each axis by itself.

    f is piecewise linear through knots (c, f(c)), and beyond the outer ones has a slope of 1. A
    policy that walks at g(u) where it observes u follows the command with f = g⁻¹. Without knots
    f(c) = c. A policy that stands at low commands, and walks on at them once it walks, has to
    begin: where it stands still though it is commanded to walk, the axis that leads is observed as
    sign(c) max(|f(c)|, s). The speed ahead leads, without one that to the left, without both the
    turn.

    Attributes:
        ahead: Knots of the speed ahead [m/s], in the order of c.
        left: Knots of the speed to the left [m/s], of c ≥ 0 from (0, 0) on: f(−c) = −f(c).
        turn: Knots of the turn rate [rad/s], of c ≥ 0 as well.
        in_place: The same where no speed is commanded; without knots `turn` holds there too.
        aside: Knots of the speed to the left where none ahead is commanded; without knots `left`.
        still: Root mean square of the joint velocities [rad/s] below which the robot stands still;
            0: never.
        start: s of ahead, left [m/s] and turn [rad/s].
        correction: k [1/s] of the integral of the velocity's error, see `correction.py`; 0: none.
        admittance: how far it gives way to a push, κ of `admittance.py`; 0: not at all.
        evasion: Knots (θ, A, L, T) [°, m/s, m/s, rad/s] of what is observed after a push, see
            `evasion.py`; from 0 to 180°.
        smoothing: the share of a new target that the servos of a robot are given that stands
            calmly, α₀ of `smoothing.py`; 1: all of it.
    """

    ahead: Knots = ()
    left: Knots = ()
    turn: Knots = ()
    in_place: Knots = ()
    aside: Knots = ()
    still: float = field(default=0.0, metadata={"min": 0.0})
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    correction: float = field(default=0.0, metadata={"min": 0.0, "max": 5.0})
    admittance: float = field(default=0.0, metadata={"min": 0.0, "max": 5.0, "omit": "default"})

    evasion: tuple[tuple[float, float, float, float], ...] = field(
        default=(), metadata={"omit": "default"}
    )
    smoothing: float = field(default=1.0, metadata={"min": 0.05, "max": 1.0, "omit": "default"})

    def __post_init__(self) -> None:
        for name in AXES:
            knots = getattr(self, name)
            if not knots:
                continue
            commands, seen = (list(column) for column in zip(*knots, strict=True))
            if commands != sorted(set(commands)) or seen != sorted(seen):
                raise ValueError(f"{name}: knots must increase")
            if (0.0, 0.0) not in [(c, u) for c, u in knots]:
                raise ValueError(f"{name}: needs the knot [0, 0], at which it stands")
            if name != "ahead" and commands[0] != 0.0:
                raise ValueError(f"{name}: must begin with [0, 0]; both sides are alike")
        if any(len(self._both(name)) > MOST_KNOTS for name in AXES):
            raise ValueError(f"at most {MOST_KNOTS} knots in an axis")
        angles = [angle for angle, *_ in self.evasion]
        if angles and (angles != sorted(set(angles)) or angles[0] != 0.0 or angles[-1] != 180.0):
            raise ValueError("evasion: angles must increase from 0 to 180°")

    def _both(self, name: str) -> Knots:
        """Return the knots of both signs."""
        knots: Knots = getattr(self, name)
        if name == "ahead":
            return knots
        return (*((-c, -u) for c, u in reversed(knots[1:])), *knots)

    def arrays(self) -> "CalibrationArrays":
        """Return the same for compiled code."""
        ahead, left, turn, in_place, aside = (
            np.array(self._both(name), float).reshape(-1, 2) for name in AXES
        )
        return CalibrationArrays(ahead, left, turn, in_place, aside, *self.start, self.still)


@dataclass(frozen=True, eq=False)
class CalibrationArrays(Block):
    """A `Calibration`: the knots (n, 2) of both signs, (0, 2) without any, and its starts."""

    ahead: np.ndarray
    left: np.ndarray
    turn: np.ndarray
    in_place: np.ndarray
    aside: np.ndarray
    start_ahead: float  # [m/s]
    start_left: float  # [m/s]
    start_turn: float  # [rad/s]
    still: float  # [rad/s]


@compiled
def through(knots: np.ndarray, command: float) -> float:
    """f(command) of the knots (n, 2)."""
    n = knots.shape[0]
    if n == 0:
        return command
    if command <= knots[0, 0]:
        return knots[0, 1] + command - knots[0, 0]
    for i in range(1, n):
        if command <= knots[i, 0]:
            fraction = (command - knots[i - 1, 0]) / (knots[i, 0] - knots[i - 1, 0])
            return knots[i - 1, 1] + fraction * (knots[i, 1] - knots[i - 1, 1])
    return knots[n - 1, 1] + command - knots[n - 1, 0]


@compiled
def begun(seen: float, command: float, start: float) -> float:
    """What is observed of the axis that leads where the robot stands still: at least `start`,
    unless it observes 0, which is to stand."""
    return max(abs(seen), start) * np.sign(command) if seen != 0.0 else seen


@compiled
def observed_ahead(
    c: CalibrationArrays, command: np.ndarray, still: bool, shift: float = 0.0, way: float = 0.0
) -> float:
    """The speed ahead of a command (≥ 3,) as it is observed, by a robot that stands `still` or not;
    `shift` is δ of a `Correction`, `way` y of an `Admittance`."""
    seen = through(c.ahead, command[0] + shift) + way
    leads = command[0] != 0.0
    return begun(seen, command[0], c.start_ahead) if still and leads else seen


@compiled
def observed_left(
    c: CalibrationArrays, command: np.ndarray, still: bool, shift: float = 0.0, way: float = 0.0
) -> float:
    """The same of the speed to the left."""
    aside = command[0] == 0.0
    seen = through(c.aside if aside and c.aside.shape[0] > 0 else c.left, command[1] + shift)
    seen += way
    leads = aside and command[1] != 0.0
    return begun(seen, command[1], c.start_left) if still and leads else seen


@compiled
def observed_turn(
    c: CalibrationArrays, command: np.ndarray, still: bool, shift: float = 0.0
) -> float:
    """The same of the turn rate."""
    in_place = command[0] == 0.0 and command[1] == 0.0
    seen = through(
        c.in_place if in_place and c.in_place.shape[0] > 0 else c.turn, command[2] + shift
    )
    return begun(seen, command[2], c.start_turn) if still and in_place else seen
