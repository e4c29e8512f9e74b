"""The configuration of `MotionStep`; numbers have the units of `stepping/planning/config.py`."""

from dataclasses import dataclass, field
from typing import Literal

from poise.baselines.balance.stepping.planning.config import CaptureStepConfig, SwingTask
from poise.baselines.whole_body.gains import MomentumQPConfig

POSITIVE, NOT_NEGATIVE = {"above": 0.0}, {"min": 0.0}


@dataclass(frozen=True)
class PerformConfig:
    """How a motion with steps is performed, and the QP of its ticks.

    Of `swing` the way is not used: it is the motion's.
    """

    gain: float = field(default=1.0, metadata=NOT_NEGATIVE)  # k of p = p_ref + (1 + k)(ξ − ξ_ref)
    # the planner of steps takes over when p_ref + ξ − ξ_ref is so far outside what one sole reaches
    margin: float = field(default=0.03, metadata=NOT_NEGATIVE)
    margin_both: float = field(default=0.06, metadata=NOT_NEGATIVE)  # the same of both
    rest_time: float = field(default=1.0, metadata=POSITIVE)  # on both feet before it goes on
    stance_error: float = field(default=0.04, metadata=POSITIVE)  # of the feet, to go on
    load_time: float = field(default=0.25, metadata=POSITIVE)  # in which a foot takes up its load
    unload_time: float = field(default=0.3, metadata=POSITIVE)  # in which it gives it away
    torque_rate_limit: float = field(default=1.4, metadata=POSITIVE)  # as in `CaptureStepConfig`
    root_accel: float = field(default=60.0, metadata=POSITIVE)
    swing_accel: float = field(default=60.0, metadata=POSITIVE)
    joint_accel: float = field(default=100.0, metadata=POSITIVE)
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


@dataclass(frozen=True)
class MotionStepConfig(CaptureStepConfig):
    """`capture-step` that performs motions with steps by `perform`."""

    kind: Literal["motion-step"] = "motion-step"  # type: ignore[assignment]
    perform: PerformConfig = field(default_factory=PerformConfig)
