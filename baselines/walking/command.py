"""The command that a walking controller follows."""

from dataclasses import dataclass

import numpy as np

from poise.configs.errors import ConfigError


@dataclass(frozen=True)
class GaitCommand:
    """A velocity along the heading, and a turn; zero is to stand.

    Attributes:
        ahead: forwards [m/s].
        left: to the left [m/s].
        turn: to the left [rad/s].
    """

    ahead: float = 0.0
    left: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        for name in ("ahead", "left", "turn"):
            if not np.isfinite(getattr(self, name)):
                raise ConfigError("must be a finite number", field=f"command.{name}")

    def array(self) -> np.ndarray:
        """(3,) ahead, left [m/s], turn [rad/s]."""
        return np.array([self.ahead, self.left, self.turn])
