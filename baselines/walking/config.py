"""The configuration of controllers that walk; units are those of `stepping/planning/config.py`."""

from dataclasses import dataclass, field, replace
from typing import Literal

from poise.baselines.balance.stepping.planning.config import (
    CaptureStepConfig,
    StepLimits,
    SwingTask,
)
from poise.baselines.balance.stepping.planning.units import number
from poise.baselines.whole_body.gains import MomentumQPConfig

from .models.lip import Lip
from .models.reference import ReferenceModel


@dataclass(frozen=True)
class TreadConfig:
    """The gait over footholds that are given, such as the treads of stairs.

    Fractions are of the time from lift-off to touchdown.
    """

    step_time: float = number(1.9, "1/ω", above=0.0)
    transfer_time: float = number(0.353, "1/ω", above=0.0)
    time_max: float = number(2.47, "1/ω", above=0.0)  # by which a step may last
    time_price: float = number(0.018, "h ω", min=0.0)
    height: float = number(0.95, "h", above=0.0)  # of the CoM above the line of the feet
    clearance: float = number(0.038, "h", above=0.0)  # above the higher tread
    margin: float = number(0.0127, "h", min=0.0)  # from the sole to the edges
    least_step: float = number(0.19, "h", above=0.0)  # towards the first tread, and
    approach: float = number(0.46, "h", above=0.0)  # the longest of these
    highest: float = number(0.25, "h", above=0.0)  # step up or down
    longest: float = number(0.6, "h", above=0.0)  # step, from tread to tread
    hold_up: float = number(0.25, min=0.0)  # before the foot goes forward
    hold_down: float = number(0.1, min=0.0)
    rise: float = number(0.48, above=0.0)  # when it is as high as it gets, going up
    rise_down: float = number(0.3, above=0.0)  # the same, going down
    lower: float = number(0.62, above=0.0)  # when it begins to come down, going up
    lower_down: float = number(0.8, above=0.0)
    arrive: float = number(0.98, above=0.0)  # when it is above its foothold
    # the trunk leans ahead by so much for each h of a rise beyond `lean_from` [rad/h]
    lean: float = number(5.0, "1/h", min=0.0)
    lean_from: float = number(0.135, "h", min=0.0)


@dataclass(frozen=True)
class GaitConfig:
    """The gait: its times, its width, how it follows a command, and the QP of its ticks."""

    step_time: float = number(1.2, "1/ω", above=0.0)  # from lift-off to touchdown
    transfer_time: float = number(0.28, "1/ω", above=0.0)  # on both feet
    width: float = number(0.254, "h", above=0.0)  # between the soles
    height: float = number(0.966, "h", above=0.0)  # of the CoM, where legs reach
    leg_length: float = number(1.04, "h", above=0.0)  # that limits it in a long step
    # what the height follows: `lip` keeps `height`, the others are in models/
    model: ReferenceModel = field(default_factory=Lip, metadata={"omit": "default"})
    acceleration: float = number(0.041, "h ω²", above=0.0)  # of the velocity, h ω² = g
    turn_acceleration: float = number(0.08, "ω²", above=0.0)  # of the turn
    # what is planned is the velocity asked for, and so much of the sum of each step's error
    correction: float = number(0.3, min=0.0)
    correction_limit: float = number(0.09, "h ω", min=0.0)
    time_price: float = number(0.018, "h ω", min=0.0)  # of another step time
    transfer_gain: float = number(1.0, min=0.0)  # of ξ's error on both feet
    start_radius: float = number(0.025, "h", above=0.0)  # of ξ before the first step
    start_time: float = number(5.0, "1/ω", above=0.0)  # then it begins anyway
    speed_margin: float = number(0.01, "h ω", min=0.0)  # slower is standing
    # of the joints of arms that swing as commanded, in the posture of the QP
    arm_weight: float = number(30.0, above=0.0, omit="default")
    # of the joints of trunk and arms, at least, while a clip is walked
    clip_weight: float = number(3.0, above=0.0, omit="default")
    # until this fraction of the swing the foot stays as high as it is at `swing.lift`, over its own
    # ground and the stance sole's; 0: it comes down once it is up, and only the latter counts
    lower: float = number(0.0, min=0.0, max=0.95, omit="default")
    # the miss of ξ at touchdown, the CoP where it brakes most, from which the steps that catch a
    # fall take over; 0: never. It walks again once both soles have been down for `calm_time`
    catch: float = number(0.0, "h", min=0.0, omit="default")
    calm_time: float = number(2.0, "1/ω", min=0.0, omit="default")
    torque_rate_limit: float = number(0.6, above=0.0)  # as in `CaptureStepConfig`
    root_accel: float = number(60.0, "ω²", above=0.0)
    swing_accel: float = number(14.0, "ω²", above=0.0)
    joint_accel: float = number(100.0, "ω²", above=0.0)
    limits: StepLimits = field(
        default_factory=lambda: StepLimits(
            ahead=1.1, behind=0.9, width_min=0.19, width_max=0.9, speed=1.3, side_speed=1.2,
            time_min=0.7, time_max=2.0,
        )
    )  # fmt: skip
    treads: TreadConfig = field(default_factory=TreadConfig, metadata={"omit": "default"})
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)

    def __post_init__(self) -> None:
        if 0.0 < self.lower < self.swing.lift:
            raise ValueError(f"lower: must be 0 or at least swing.lift, {self.swing.lift:g}")

    @property
    def lifting(self) -> SwingTask:
        """`swing` with the fraction of the time in which the foot rises or, if less, comes down."""
        return replace(self.swing, lift=min(self.swing.lift, 1.0 - self.lower))


@dataclass(frozen=True)
class WalkConfig(CaptureStepConfig):
    """`capture-step` that walks with this `gait` while commanded to."""

    kind: Literal["walk"] = "walk"  # type: ignore[assignment]
    gait: GaitConfig = field(default_factory=GaitConfig)
