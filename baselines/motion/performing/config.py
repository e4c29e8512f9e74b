"""The configuration of `MotionStep`; numbers have the units of `stepping/planning/config.py`."""

from dataclasses import dataclass, field
from typing import Literal

from poise.baselines.balance.stepping.planning.config import CaptureStepConfig, SwingTask
from poise.baselines.balance.stepping.planning.units import number
from poise.baselines.whole_body.gains import MomentumQPConfig


@dataclass(frozen=True)
class PerformConfig:
    """How a motion with steps is performed, and the QP of its ticks.

    Of `swing` the way is not used: it is the motion's.
    """

    gain: float = number(1.0, min=0.0)  # k of p = p_ref + (1 + k)(ξ − ξ_ref)
    # the planner of steps takes over when p_ref + ξ − ξ_ref is so far outside what one sole reaches
    margin: float = number(0.03, "h", min=0.0)
    margin_both: float = number(0.06, "h", min=0.0)  # the same of both
    rest_time: float = number(1.0, "1/ω", above=0.0)  # on both feet before it goes on
    stance_error: float = number(0.04, "h", above=0.0)  # of the feet, to go on
    load_time: float = number(0.25, "1/ω", above=0.0)  # in which a foot takes up its load
    unload_time: float = number(0.3, "1/ω", above=0.0)  # in which it gives it away
    torque_rate_limit: float = number(1.4, above=0.0)  # as in `CaptureStepConfig`
    root_accel: float = number(60.0, "ω²", above=0.0)
    swing_accel: float = number(60.0, "ω²", above=0.0)
    joint_accel: float = number(100.0, "ω²", above=0.0)
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


@dataclass(frozen=True)
class MotionStepConfig(CaptureStepConfig):
    """`capture-step` that performs motions with steps by `perform`."""

    kind: Literal["motion-step"] = "motion-step"  # type: ignore[assignment]
    perform: PerformConfig = field(default_factory=PerformConfig)
