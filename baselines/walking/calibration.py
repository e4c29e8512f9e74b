"""The command as a policy observes it: what it must be asked for so that the robot does as
commanded."""

from dataclasses import dataclass, field

import numpy as np

from poise.envs.compiled.jit import compiled

MOST_KNOTS = 32  # of an axis, both signs together
ROWS = ("ahead", "left", "turn", "in_place", "aside")
AHEAD, LEFT, TURN, IN_PLACE, ASIDE = range(5)

Knots = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Calibration:
    """A policy observes f(c) in the place of a command c, each axis by itself.

    f is piecewise linear through knots (c, f(c)), and beyond the outer ones has a slope of 1. A
    policy that walks at g(u) where it observes u follows the command with f = g⁻¹. Without knots
    f(c) = c. A policy that stands at low commands, and walks on at them once it walks, has to begin:
    where it stands still though it is commanded to walk, the axis that leads is observed as
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
    """

    ahead: Knots = ()
    left: Knots = ()
    turn: Knots = ()
    in_place: Knots = ()
    aside: Knots = ()
    still: float = field(default=0.0, metadata={"min": 0.0})
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    correction: float = field(default=0.0, metadata={"min": 0.0, "max": 5.0})

    def __post_init__(self) -> None:
        for name in ROWS:
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
        if any(len(self._both(name)) > MOST_KNOTS for name in ROWS):
            raise ValueError(f"at most {MOST_KNOTS} knots in an axis")

    def _both(self, name: str) -> Knots:
        """Return the knots of both signs."""
        knots: Knots = getattr(self, name)
        if name == "ahead":
            return knots
        return (*((-c, -u) for c, u in reversed(knots[1:])), *knots)

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the knots (5, 32, 2) of `ROWS`, and how many of each count (5,)."""
        table, count = np.zeros((len(ROWS), MOST_KNOTS, 2)), np.zeros(len(ROWS))
        for a, name in enumerate(ROWS):
            knots = self._both(name)
            count[a] = len(knots)
            if knots:
                table[a, : len(knots)] = knots
        return table, count


@compiled
def through(knots: np.ndarray, n: int, command: float) -> float:
    """f(command) of the first `n` of the knots (m, 2)."""
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
def calibrated(
    table: np.ndarray, count: np.ndarray, command: np.ndarray, axis: int, shift: float = 0.0
) -> float:
    """f(c + shift) of an axis of the command (≥ 3,); table and count as of `Calibration.table`."""
    row = axis
    if axis == TURN and count[IN_PLACE] > 0.0 and command[AHEAD] == 0.0 and command[LEFT] == 0.0:
        row = IN_PLACE
    elif axis == LEFT and count[ASIDE] > 0.0 and command[AHEAD] == 0.0:
        row = ASIDE
    return through(table[row], int(count[row]), command[axis] + shift)


@compiled
def begun(seen: float, command: np.ndarray, axis: int, start: float) -> float:
    """What is observed of an axis where the robot stands still: at least `start` if it leads and
    does not observe 0, which is to stand."""
    lead = AHEAD
    while lead < TURN and command[lead] == 0.0:
        lead += 1
    if axis != lead or seen == 0.0:
        return seen
    return max(abs(seen), start) * np.sign(command[lead])
