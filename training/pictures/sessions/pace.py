"""Simulated time against the wall clock."""

import time
from collections import deque
from collections.abc import Callable

BACKLOG = 0.1  # [s] of simulated time that may be caught up; more than that is given up
WINDOW = 2.0  # [s] over which the factor of this moment is taken


class RealTimePace:
    """Compute how many steps are due, and how close to real time they run.

    Args:
        clock: seconds of the wall clock.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock, self._last = clock, clock()
        self.speed = 1.0  #: simulated over wall-clock seconds that is wanted
        self.wanted = self.stepped = 0.0  #: [s] due by speed and clock; simulated
        self._owed, self._period = 0.0, 1.0
        self._recent: deque[tuple[float, float]] = deque()

    def due(self, period: float) -> int:
        """Return the number of steps of `period` [s] to run now; they count as run."""
        self._period = period
        elapsed = self._elapsed() * self.speed
        self.wanted += elapsed
        self._owed = min(self._owed + elapsed, max(BACKLOG, period))
        count = int(self._owed / period + 1e-9)
        self._owed -= count * period
        self.stepped += count * period
        self._recent.append((self.wanted, self.stepped))
        while self.wanted - self._recent[0][0] > WINDOW * self.speed:
            self._recent.popleft()
        return count

    def rest(self) -> None:
        """Let time pass that does not count: paused, or busy with something else."""
        self._elapsed()
        self._recent.clear()

    @property
    def phase(self) -> float:
        """How much of the next step's time is over, 0 to 1 (with steps of `period` as of `due`)."""
        return min(self._owed / self._period, 1.0)

    def until_due(self, period: float) -> float:
        """Return the wall-clock time [s] until the next step is due."""
        return max((period - self._owed) / self.speed, 0.0)

    @property
    def factor(self) -> float:
        """Simulated over due time in the last seconds: 1 is real time, at the chosen speed."""
        if len(self._recent) < 2:
            return 1.0
        (first, before), (last, now) = self._recent[0], self._recent[-1]
        return (now - before) / (last - first) if last > first else 1.0

    @property
    def total(self) -> float:
        """The same over all the time that counted."""
        return self.stepped / self.wanted if self.wanted > 0.0 else 1.0

    def _elapsed(self) -> float:
        now = self._clock()
        elapsed, self._last = now - self._last, now
        return elapsed
