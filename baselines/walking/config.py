"""The configuration of controllers that walk; units are those of `stepping/planning/config.py`."""

from dataclasses import dataclass, field, replace
from typing import Literal

from poise.baselines.balance.stepping.planning.config import (
    CaptureStepConfig,
    StepLimits,
    SwingTask,
)
from poise.baselines.whole_body.gains import MomentumQPConfig

from .models.lip import Lip
from .models.reference import ReferenceModel

POSITIVE, NOT_NEGATIVE = {"above": 0.0}, {"min": 0.0}


@dataclass(frozen=True)
class TreadConfig:
    """The gait over footholds that are given, such as the treads of stairs.

    Fractions are of the time from lift-off to touchdown.
    """

    step_time: float = field(default=1.9, metadata=POSITIVE)
    transfer_time: float = field(default=0.353, metadata=POSITIVE)
    time_max: float = field(default=2.47, metadata=POSITIVE)  # by which a step may last
    time_price: float = field(default=0.018, metadata=NOT_NEGATIVE)
    height: float = field(default=0.95, metadata=POSITIVE)  # of the CoM above the line of the feet
    clearance: float = field(default=0.038, metadata=POSITIVE)  # above the higher tread
    margin: float = field(default=0.0127, metadata=NOT_NEGATIVE)  # from the sole to the edges
    least_step: float = field(default=0.19, metadata=POSITIVE)  # towards the first tread, and
    approach: float = field(default=0.46, metadata=POSITIVE)  # the longest of these
    highest: float = field(default=0.25, metadata=POSITIVE)  # step up or down
    longest: float = field(default=0.6, metadata=POSITIVE)  # step, from tread to tread
    hold_up: float = field(default=0.25, metadata=NOT_NEGATIVE)  # before the foot goes forward
    hold_down: float = field(default=0.1, metadata=NOT_NEGATIVE)
    rise: float = field(default=0.48, metadata=POSITIVE)  # when it is as high as it gets, going up
    rise_down: float = field(default=0.3, metadata=POSITIVE)  # the same, going down
    lower: float = field(default=0.62, metadata=POSITIVE)  # when it begins to come down, going up
    lower_down: float = field(default=0.8, metadata=POSITIVE)
    arrive: float = field(default=0.98, metadata=POSITIVE)  # when it is above its foothold
    # the trunk leans ahead by so much for each h of a rise beyond `lean_from` [rad/h]
    lean: float = field(default=5.0, metadata=NOT_NEGATIVE)
    lean_from: float = field(default=0.135, metadata=NOT_NEGATIVE)


@dataclass(frozen=True)
class GaitConfig:
    """The gait: its times, its width, how it follows a command, and the QP of its ticks."""

    step_time: float = field(default=1.2, metadata=POSITIVE)  # from lift-off to touchdown
    transfer_time: float = field(default=0.28, metadata=POSITIVE)  # on both feet
    width: float = field(default=0.254, metadata=POSITIVE)  # between the soles
    height: float = field(default=0.966, metadata=POSITIVE)  # of the CoM, where legs reach
    leg_length: float = field(default=1.04, metadata=POSITIVE)  # that limits it in a long step
    # what the height follows: `lip` keeps `height`, the others are in models/
    model: ReferenceModel = field(default_factory=Lip, metadata={"omit": "default"})
    acceleration: float = field(default=0.041, metadata=POSITIVE)  # of the velocity [g]
    turn_acceleration: float = field(default=0.08, metadata=POSITIVE)  # of the turn [ω²]
    # what is planned is the velocity asked for, and so much of the sum of each step's error
    correction: float = field(default=0.3, metadata=NOT_NEGATIVE)
    correction_limit: float = field(default=0.09, metadata=NOT_NEGATIVE)  # [h ω]
    time_price: float = field(default=0.018, metadata=NOT_NEGATIVE)  # of another step time [h ω]
    transfer_gain: float = field(default=1.0, metadata=NOT_NEGATIVE)  # of ξ's error on both feet
    start_radius: float = field(default=0.025, metadata=POSITIVE)  # of ξ before the first step
    start_time: float = field(default=5.0, metadata=POSITIVE)  # then it begins anyway
    speed_margin: float = field(default=0.01, metadata=NOT_NEGATIVE)  # slower is standing [h ω]
    # of the joints of arms that swing as commanded, in the posture of the QP
    arm_weight: float = field(default=30.0, metadata={**POSITIVE, "omit": "default"})
    # until this fraction of the swing the foot stays as high as it is at `swing.lift`, over its own
    # ground and the stance sole's; 0: it comes down once it is up, and only the latter counts
    lower: float = field(default=0.0, metadata={"min": 0.0, "max": 0.95, "omit": "default"})
    torque_rate_limit: float = field(default=0.6, metadata=POSITIVE)  # as in `CaptureStepConfig`
    root_accel: float = field(default=60.0, metadata=POSITIVE)
    swing_accel: float = field(default=14.0, metadata=POSITIVE)
    joint_accel: float = field(default=100.0, metadata=POSITIVE)
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
    """`capture-step` that walks with this `gait` while it is told to."""

    kind: Literal["walk"] = "walk"  # type: ignore[assignment]
    gait: GaitConfig = field(default_factory=GaitConfig)
