"""How long a search takes, and whether another generation fits into its minutes."""

import time

import numpy as np


class GenerationPace:
    """How long the generations of one call take, and whether another one fits its minutes."""

    def __init__(self, minutes: float | None):
        self.started, self.done = time.monotonic(), 0
        self.seconds = np.inf if minutes is None else 60.0 * minutes

    def count(self) -> None:
        """A generation has ended."""
        self.done += 1
        self.each = (time.monotonic() - self.started) / self.done  # [s]

    def allows_another(self) -> bool:
        """Return True for the first generation, and for one that would end in time."""
        return self.done == 0 or (self.done + 1) * self.each <= self.seconds

    def words(self, left: int) -> str:
        """Return the end of a line: how long a generation takes, and all that are `left`."""
        text, seconds = f"; {self.each:.1f} s each", left * self.each
        if left and self.allows_another():
            text += f", {min(seconds, self.seconds - self.done * self.each) / 60.0:.1f} min left"
        return text
