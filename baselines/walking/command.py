"""The command that a walking controller follows."""

from dataclasses import dataclass, field

import numpy as np

from poise.configs.errors import ConfigError

MOST_STEP_TIME = 5.0  # [s] by which ξ has left any robot that stands on one foot


@dataclass(frozen=True)
class GaitCommand:
    """A velocity along the heading, and a turn; zero is to stand.

    Attributes:
        ahead: forwards [m/s].
        left: to the left [m/s].
        turn: to the left [rad/s].
        step_time: from lift-off to touchdown [s], at most 5; None: the gait's own.
        width: between the soles [m]; None: the gait's own.

    With the gait's T_d on both feet a step is as long as `ahead` · (`step_time` + T_d).
    """

    ahead: float = 0.0
    left: float = 0.0
    turn: float = 0.0
    step_time: float | None = field(
        default=None, kw_only=True, metadata={"above": 0.0, "max": MOST_STEP_TIME}
    )
    width: float | None = field(default=None, kw_only=True, metadata={"above": 0.0})

    def __post_init__(self) -> None:
        for name in ("ahead", "left", "turn"):
            if not np.isfinite(getattr(self, name)):
                raise ConfigError("must be a finite number", field=f"command.{name}")
        if self.step_time is not None and not 0.0 < self.step_time <= MOST_STEP_TIME:
            raise ConfigError(f"must be above 0 and at most {MOST_STEP_TIME:g}, not "
                              f"{self.step_time:g}", field="command.step_time")  # fmt: skip
        if self.width is not None and not 0.0 < self.width < np.inf:
            raise ConfigError("must be a finite number above 0", field="command.width")

    def array(self) -> np.ndarray:
        """(5,) ahead, left [m/s], turn [rad/s], step time [s], width [m]; 0: the gait's own."""
        return np.array([self.ahead, self.left, self.turn, self.step_time or 0, self.width or 0])
