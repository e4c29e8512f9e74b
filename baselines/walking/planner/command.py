"""The command that a walking controller follows."""

from dataclasses import dataclass, field

import numpy as np

from poise.baselines.controller import COMMAND_ENTRIES
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
        clearance: of the swinging sole above the ground at its highest [m]; None: the gait's own.
        arm_swing: of each arm about the robot's left axis, to either side, against the leg of its
            side [rad]; None or 0: arms are free to balance the robot.
        step_length: [m], in place of `step_time`.

    With the gait's T_d on both feet a step is as long as the speed · (`step_time` + T_d).
    """

    ahead: float = 0.0
    left: float = 0.0
    turn: float = 0.0
    step_time: float | None = field(
        default=None, kw_only=True, metadata={"above": 0.0, "max": MOST_STEP_TIME}
    )
    width: float | None = field(default=None, kw_only=True, metadata={"above": 0.0})
    clearance: float | None = field(default=None, kw_only=True, metadata={"above": 0.0})
    arm_swing: float | None = field(default=None, kw_only=True, metadata={"min": 0.0})
    step_length: float | None = field(default=None, kw_only=True, metadata={"above": 0.0})

    def __post_init__(self) -> None:
        for name in ("ahead", "left", "turn"):
            if not np.isfinite(getattr(self, name)):
                raise ConfigError("must be a finite number", field=f"command.{name}")
        if self.step_time is not None and not 0.0 < self.step_time <= MOST_STEP_TIME:
            raise ConfigError(f"must be above 0 and at most {MOST_STEP_TIME:g}, not "
                              f"{self.step_time:g}", field="command.step_time")  # fmt: skip
        for name in ("width", "clearance", "step_length"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise ConfigError("must be a finite number above 0", field=f"command.{name}")
        if self.arm_swing is not None and not 0.0 <= self.arm_swing < np.inf:
            raise ConfigError("must be a finite number, 0 or above", field="command.arm_swing")
        if self.step_length is None:
            return
        if self.step_time is not None:
            raise ConfigError("give step_time or step_length, not both",
                              field="command.step_length")  # fmt: skip
        if not self.speed:
            raise ConfigError("needs a speed ahead or to the left", field="command.step_length")

    @property
    def speed(self) -> float:
        """√(ahead² + left²) [m/s]."""
        return float(np.hypot(self.ahead, self.left))

    def array(self) -> np.ndarray:
        """(8,) ahead, left [m/s], turn [rad/s], step time [s], width, clearance [m], arm swing
        [rad], step length [m]; 0: the gait's own."""
        own = [getattr(self, name) or 0.0 for name in STEP_PARAMETERS]
        return np.array([self.ahead, self.left, self.turn, *own])


def command_of(array: np.ndarray) -> GaitCommand:
    """The command that `GaitCommand.array` gives as (8,)."""
    ahead, left, turn, *own = (float(value) for value in array)
    steps = {name: value or None for name, value in zip(STEP_PARAMETERS, own, strict=True)}
    return GaitCommand(ahead, left, turn, **steps)


#: of a command, in addition to its velocity and turn
STEP_PARAMETERS = ("step_time", "width", "clearance", "arm_swing", "step_length")
ENTRIES = COMMAND_ENTRIES  #: of the array of a command
