"""Footsteps of a robot while it performs a motion, against the motion's."""

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.footfalls import COLUMNS, Footfalls, step_vector
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.envs.balance.base import BalanceEnv
from poise.envs.compiled.maths.vectors import rotation_vector
from poise.training.benchmarking.trials.play import Watch

SWUNG = 4  # policy steps of swing after which a foot lands: 0.08 s
CLOSE = 0.1  # [s] from the motion's footfall
MOST_DELAY = 0.6  # [s] of a walk, whose planner takes its first step when it has to
AROUND = 0.25  # [s] before the first and after the last footfall in which others count


class Footsteps(NamedTuple):
    """How the steps of a trial compare with its motion's; NaN of a motion without steps.

    Attributes:
        number: the robot's over the motion's.
        kept: share of the steps, the motion's or the robot's, whichever are more, that the same
            foot took within 0.1 s.
        delay: of the robot [s]; constant, and 0 but of a walk by commands.
        place: mean distance of these from where the motion has them from the other foot [m].
    """

    number: float = np.nan
    kept: float = np.nan
    delay: float = np.nan
    place: float = np.nan


class Steps:
    """The footfalls of a trial: a `Watch` that also calls another."""

    def __init__(self, motion: ReferenceMotion, other: Watch | None = None):
        self._wanted, self._other = motion.footfalls, other
        self._most = 0.0 if motion.commands is None else MOST_DELAY
        self._off = np.zeros(2, int)  # policy steps since a foot touched the ground
        self._found: list[tuple[float, ...]] = []

    def __call__(self, env: BalanceEnv) -> object:
        state = env.simulation.state
        down = np.asarray(state.contacts) > 0.0
        for foot in np.flatnonzero(down & (self._off >= SWUNG)):
            turns = np.array([rotation_vector(axes) for axes in state.sole_axes])
            vector = step_vector(state.sole_points, turns, int(foot))
            time = getattr(env, "motion_time")  # noqa: B009  of those that play motions
            self._found.append((float(time), float(foot), *vector))
        self._off = np.where(down, 0, self._off + 1)
        return None if self._other is None else self._other(env)

    def figures(self) -> Footsteps:
        """Return the comparison so far."""
        return compare(self._wanted, np.array(self._found).reshape(-1, COLUMNS), self._most)


def compare(wanted: np.ndarray, found: np.ndarray, most_delay: float = 0.0) -> Footsteps:
    """Compare footfalls (n, 4) and (m, 4), see `footfalls`, that may be late as a whole.

    Of the delays up to `most_delay` [s] either way it is the one with which most steps are kept,
    the smallest of these. Steps 0.25 s before the first or after the last one wanted do not count.
    """
    if not len(wanted):
        return Footsteps()
    goals, steps = Footfalls(*wanted.T), Footfalls(*found.T)
    gaps = steps.time[:, None] - goals.time
    same = (steps.foot[:, None] == goals.foot) & (np.abs(gaps) <= most_delay)
    delays = sorted({0.0, *gaps[same].tolist()}, key=abs)
    pairs, delay = max(((_pairs(goals, steps, d), d) for d in delays), key=lambda e: len(e[0]))
    first, last = goals.time[[0, -1]] + [delay - AROUND, delay + AROUND]
    number = int(np.sum((steps.time >= first) & (steps.time <= last)))
    away = [np.hypot(steps.ahead[j] - goals.ahead[i], steps.left[j] - goals.left[i])
            for i, j in pairs]  # fmt: skip
    kept = len(pairs) / max(len(wanted), number)
    return Footsteps(number / len(wanted), kept, delay, float(np.mean(away)) if away else np.nan)


def _pairs(goals: Footfalls, steps: Footfalls, delay: float) -> list[tuple[int, int]]:
    """Return indices of steps of the same foot within 0.1 s, each of one pair at most."""
    pairs, left = [], list(range(len(steps.time)))
    for i, time in enumerate(goals.time):
        late = np.abs(steps.time - delay - time)
        near = [j for j in left if steps.foot[j] == goals.foot[i] and late[j] <= CLOSE + 1e-9]
        if near:
            best = min(near, key=late.__getitem__)
            pairs.append((i, best))
            left.remove(best)
    return pairs
