"""The command that a walking controller follows."""

from dataclasses import dataclass, field

import numpy as np

from poise.configs.errors import ConfigError


@dataclass(frozen=True)
class GaitCommand:
    """A velocity along the heading, and a turn; zero is to stand.

    Attributes:
        ahead: forwards [m/s].
        left: to the left [m/s].
        turn: to the left [rad/s].
        step_time: from lift-off to touchdown [s]; None: the gait's own.
        width: between the soles [m]; None: the gait's own.

    With the gait's T_d on both feet a step is as long as `ahead` · (`step_time` + T_d).
    """

    ahead: float = 0.0
    left: float = 0.0
    turn: float = 0.0
    step_time: float | None = field(default=None, kw_only=True, metadata={"above": 0.0})
    width: float | None = field(default=None, kw_only=True, metadata={"above": 0.0})

    def __post_init__(self) -> None:
        for name in ("ahead", "left", "turn"):
            if not np.isfinite(getattr(self, name)):
                raise ConfigError("must be a finite number", field=f"command.{name}")
        for name in ("step_time", "width"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise ConfigError("must be a finite number above 0", field=f"command.{name}")

    def array(self) -> np.ndarray:
        """(5,) ahead, left [m/s], turn [rad/s], step time [s], width [m]; 0: the gait's own."""
        return np.array([self.ahead, self.left, self.turn, self.step_time or 0, self.width or 0])
