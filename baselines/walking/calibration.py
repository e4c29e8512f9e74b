"""The command as a policy observes it: what it must be asked for so that the robot does as
commanded."""

from dataclasses import dataclass

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled

MOST_KNOTS = 32  # of an axis, both signs together
AXES = ("ahead", "left", "turn", "in_place")

Knots = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Calibration:
    """A policy observes f(c) in the place of a command c, each axis by itself.

    f is piecewise linear through knots (c, f(c)), and beyond the outer ones has a slope of 1. A
    policy that walks at g(u) where it observes u follows the command with f = g⁻¹. Without knots
    f(c) = c.

    Attributes:
        ahead: Knots of the speed ahead [m/s], in the order of c.
        left: Knots of the speed to the left [m/s], of c ≥ 0 from (0, 0) on: f(−c) = −f(c).
        turn: Knots of the turn rate [rad/s], of c ≥ 0 as well.
        in_place: The same where no speed is commanded; without knots `turn` holds there too.
    """

    ahead: Knots = ()
    left: Knots = ()
    turn: Knots = ()
    in_place: Knots = ()

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

    def _both(self, name: str) -> Knots:
        """Return the knots of both signs."""
        knots: Knots = getattr(self, name)
        if name == "ahead":
            return knots
        return (*((-c, -u) for c, u in reversed(knots[1:])), *knots)

    def knots(self) -> "CommandKnots":
        """Return the knots of both signs, for compiled code."""
        return CommandKnots(*(np.array(self._both(name), float).reshape(-1, 2) for name in AXES))


@dataclass(frozen=True, eq=False)
class CommandKnots(Block):
    """The knots (n, 2) of each axis of a `Calibration`, of both signs; (0, 2) without any."""

    ahead: np.ndarray
    left: np.ndarray
    turn: np.ndarray
    in_place: np.ndarray


@compiled
def calibrated(knots: np.ndarray, command: float) -> float:
    """f(command) of an axis with these knots (n, 2)."""
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
def calibrated_turn(knots: CommandKnots, command: np.ndarray) -> float:
    """f of the turn rate of a command (≥ 3,): ahead, left, turn."""
    in_place = knots.in_place.shape[0] > 0 and command[0] == 0.0 and command[1] == 0.0
    return calibrated(knots.in_place if in_place else knots.turn, command[2])
