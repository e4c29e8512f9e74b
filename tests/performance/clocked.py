"""Controllers whose ticks are timed by what they do; for the benchmarks beside it."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable

from poise.baselines.controller import Controller, WrappedController


class ClockedByKind(WrappedController):
    """A controller that keeps the processor time of each tick [s] by `kind` of what it did."""

    def __init__(self, controller, robot, kind: Callable[[Controller], str]):
        super().__init__(controller, robot)
        self.kind = kind
        self.seconds: dict[str, list[float]] = defaultdict(list)

    def torques(self, state, targets):
        begun = time.thread_time()
        tau = self.inner.torques(state, targets)
        spent = time.thread_time() - begun
        self.seconds[self.kind(self.inner)].append(spent)
        return tau
