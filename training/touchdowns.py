"""Counting steps: feet that left the ground for a while and came back."""

import numpy as np

AIR_TIME = 0.08  # [s] off the ground, below which a foot has only rocked or bounced


class Touchdowns:
    """Counts touchdowns of feet that were in the air for at least `AIR_TIME`.

    Args:
        feet: number of feet.
        period: seconds between two calls of `update`.
    """

    def __init__(self, feet: int, period: float):
        self.count = 0
        self._least = max(round(AIR_TIME / period), 1)
        self._air = np.zeros(feet, dtype=int)  # updates in a row without contact

    def update(self, contacts: np.ndarray) -> None:
        """(feet,) 1 where a foot touches the ground, else 0."""
        down = contacts > 0.5
        self.count += int(np.sum(down & (self._air >= self._least)))
        self._air = np.where(down, 0, self._air + 1)
