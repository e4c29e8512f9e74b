"""Getting up: whether and when a robot on the ground stands again."""

from dataclasses import dataclass

import numpy as np

from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.termination import uprightness

UP_HEIGHT = 0.8  # of the standing CoM height over the ground
UP_TILT = np.cos(np.radians(30.0))  # of the root from standing
HELD = 1.0  # [s] for which it must be up


@dataclass(frozen=True)
class Rise:
    """The outcome of getting up.

    Attributes:
        up_again: whether the robot was up for the last second that was looked at.
        up_time: from the start of the watch to the start of the first second in which it was up
            all the time [s]; None without one.
    """

    up_again: bool
    up_time: float | None


def is_up(env: BalanceEnv) -> bool:
    """Return whether the robot is on its feet alone: the root within 30° of standing, the CoM at
    0.8 of its standing height or higher, nothing but the feet on the ground."""
    s = env.simulation.state_arrays
    high = s.com[2] >= UP_HEIGHT * env.robot.height_com
    return bool(high and uprightness(env.simulation.arrays, s) > UP_TILT and s.other_contacts < 0.5)


class Rising:
    """Watches a robot that is down; call `update` after every policy step."""

    def __init__(self, env: BalanceEnv):
        self._env, self._begin = env, env.simulation.time
        self._since: float | None = None  # it is up without a break [s]
        self._first: float | None = None

    def update(self) -> None:
        """Update from the robot's current state."""
        now = self._env.simulation.time
        if not is_up(self._env):
            self._since = None
        elif self._since is None:
            self._since = now
        if self._first is None and self.held:
            self._first = self._since

    @property
    def held(self) -> bool:
        """Whether it has been up for the last second."""
        since = self._since
        return since is not None and self._env.simulation.time - since >= HELD - 1e-9

    def outcome(self) -> Rise:
        """Return the outcome so far."""
        return Rise(self.held, None if self._first is None else self._first - self._begin)
