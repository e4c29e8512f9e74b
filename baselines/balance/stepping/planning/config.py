"""The configuration of the controllers that step, as their YAML files have it.

Numbers are in the units of `in_si`: lengths in h, times in 1/ω and speeds in h ω, with h the height
of the standing CoM and ω = √(g/h). A field without a unit is a number, or says its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar, Literal

import numpy as np

from poise.baselines.whole_body.gains import MomentumQPConfig

from .units import number


@dataclass(frozen=True)
class StepLimits:
    """The footholds that a foot may reach, from the stance foot in the heading, and its speed."""

    ahead: float = number(0.75, "h", min=0.0)
    behind: float = number(0.7, "h", min=0.0)
    width_min: float = number(0.19, "h", above=0.0)  # keeps legs from crossing, feet from touching
    width_max: float = number(0.75, "h", above=0.0)
    speed: float = number(0.7, "h ω", above=0.0)  # mean speed of a swing along the heading
    side_speed: float = number(0.5, "h ω", above=0.0)  # and across it
    time_min: float = number(0.9, "1/ω", above=0.0)  # from lift-off to touchdown
    time_max: float = number(1.4, "1/ω", above=0.0)

    def __post_init__(self) -> None:
        if self.time_max < self.time_min:
            raise ValueError(f"time_max: must be at least time_min, {self.time_min}")
        if self.width_max < self.width_min:
            raise ValueError(f"width_max: must be at least width_min, {self.width_min}")


@dataclass(frozen=True)
class FootholdChoice:
    """The place of a foothold relative to the capture point that it stops, and a step's cost."""

    sagittal_offset: float = number(0.04, "h")  # beyond ξ along the heading
    # beyond ξ to the foot's own side, so that ξ ends between the feet
    lateral_offset: float = number(0.08, "h")
    margin: float = number(0.06, "h", min=0.0)  # a ξ further inside the CoP region is no better
    time_price: float = number(0.04, "h ω", min=0.0)  # cost of a step's time

    RENAMED: ClassVar[Mapping[str, str]] = {
        "overshoot": "sagittal_offset", "outward": "lateral_offset", "haste": "time_price",
    }  # fmt: skip


@dataclass(frozen=True)
class SignalGains:
    """The gains of one choice of a step, one for each signal; no signal has a unit."""

    constant: float = 0.0  # of 1
    later_step: float = 0.0  # of 1 in all steps but the first
    phase: float = 0.0  # of the fraction of the swing that is over
    capture_ahead: float = 0.0  # of ξ from the stance sole, in h
    capture_outward: float = 0.0
    lean_ahead: float = 0.0  # of the horizontal part of the root's axis that stands at rest
    lean_outward: float = 0.0
    momentum_ahead: float = 0.0  # of ω L/(m g h), L the angular momentum that turns the body there
    momentum_outward: float = 0.0

    RENAMED: ClassVar[Mapping[str, str]] = {
        "again": "later_step",
        "spin_ahead": "momentum_ahead",
        "spin_outward": "momentum_outward",
    }


SIGNALS = tuple(signal.name for signal in fields(SignalGains))


@dataclass(frozen=True)
class StepFeedback:
    """The rows of K in Δ = K s: what lean and turn of the body add to the choices of a step.

    `outward` is to the swinging foot's own side.
    """

    ahead: SignalGains = field(default_factory=SignalGains)  # foothold
    outward: SignalGains = field(default_factory=SignalGains)  # foothold
    time: SignalGains = field(default_factory=SignalGains)  # from lift-off to touchdown
    height: SignalGains = field(default_factory=SignalGains)  # of the CoM in a swing

    def matrix(self) -> np.ndarray:
        """K (4, 9), without units."""
        rows = (self.ahead, self.outward, self.time, self.height)
        return np.array([[getattr(row, name) for name in SIGNALS] for row in rows])


@dataclass(frozen=True)
class FallFeedback(StepFeedback):
    """An addition to K in the first step of a fall along `angle` [°], to either side.

    Gains of `later_step` do nothing here, since that signal is 0 in a first step.
    """

    angle: float = field(kw_only=True, metadata={"min": 0.0, "max": 180.0})


@dataclass(frozen=True)
class PivotGains:
    """The shift r of a point by turn and lean of the body, r = `momentum` ω L/(m g) + `lean` h e.

    e is the horizontal part of the root's axis that stands at rest, L the angular momentum that
    turns the body along r. No gain has a unit.
    """

    momentum: float = 0.0
    lean: float = 0.0


@dataclass(frozen=True)
class PivotConfig:
    """A trunk that is righted before the fall is stopped [Maus10]; gains of zero are without it.

    With c̈ = ω² (c − p + r) the force of the ground passes the CoM at r behind: towards a point
    above it, a virtual pivot, which takes turn and lean of the trunk back. The fall goes on for it,
    so that steps are planned for ξ + r.
    """

    plan: PivotGains = field(default_factory=PivotGains)  # of the ξ that steps and CoP follow
    swing: PivotGains = field(default_factory=PivotGains)  # of c̈ on one foot
    stance: PivotGains = field(default_factory=PivotGains)  # and on both
    lateral_fraction: float = number(1.0, min=0.0)  # of r that counts across the heading


@dataclass(frozen=True)
class RecentringConfig:
    """The return of the feet to the nominal stance, the one of standing."""

    distance: float = number(0.0, "h", min=0.0)  # of a foot from its nominal place; 0: never
    calm_speed: float = number(0.1, "h ω", min=0.0)  # the robot is calm while its CoM is slower
    calm_tilt: float = number(35.0, "°", above=0.0, max=180.0)  # and its root is tilted less
    calm_time: float = number(0.5, "1/ω", min=0.0)  # for which it must be calm
    # ξ is brought so far from the middle of the stance sole's region, towards where the other foot
    # goes; and also by this fraction of the other foot's way against it, since the swing leg takes
    # ξ along
    capture_offset: float = number(0.025, "h", min=0.0)
    counterbalance: float = number(0.07, min=0.0)
    arrival_radius: float = number(0.02, "h", above=0.0)  # ξ has arrived when it is this near
    shift_time_max: float = number(3.0, "1/ω", min=0.0)  # then the foot lifts off wherever ξ is
    swing_time: float = number(1.0, "1/ω", above=0.0)
    margin: float = number(0.015, "h")  # of ξ inside the region of both soles at touchdown
    # most that the CoP is away from ξ after touchdown, so that the foot that has just landed is not
    # relieved again
    cop_distance: float = number(0.05, "h", min=0.0)

    RENAMED: ClassVar[Mapping[str, str]] = {
        "far": "distance", "calm": "calm_speed", "tilt": "calm_tilt", "after": "calm_time",
        "lean": "capture_offset", "counter": "counterbalance", "near": "arrival_radius",
        "patience": "shift_time_max", "time": "swing_time", "press": "cop_distance",
    }  # fmt: skip


@dataclass(frozen=True)
class SwingTask:
    """J_swing v̇ + J̇ v = a_ref + k (x_ref ⊖ x) + d (ẋ_ref − ẋ), k = `stiffness`, d = 2 ζ √k.

    Units are those of `whole_body/gains.py`: weights per g² and (g/h)², a stiffness of 1 is ω².
    """

    weight: float = number(1000.0, above=0.0)
    turn_weight: float = number(100.0, above=0.0)
    yaw_fraction: float = number(1.0, min=0.0)  # of `turn_weight`, about the vertical
    stiffness: float = number(60.0, min=0.0)
    damping_ratio: float = number(1.0, min=0.0)  # ζ
    clearance: float = number(0.06, "h", above=0.0, max=0.5)  # of the sole above the ground
    lift: float = number(0.45, above=0.0, max=0.9)  # fraction of the swing in which it rises
    landing_speed: float = number(0.1, "h ω", min=0.0)  # downwards

    RENAMED: ClassVar[Mapping[str, str]] = {"yaw_share": "yaw_fraction"}


@dataclass(frozen=True)
class CaptureStepConfig:
    """Feet fixed by `qp`; steps by `step_qp` and `swing` where this does not suffice."""

    kind: Literal["capture-step"] = "capture-step"
    # The controller that replaces it at realism levels with sensor errors or randomised bodies, if
    # joints and IMU may err by `uncertain_from` [rad]; a `base` passes neither on.
    uncertain: str | None = field(default=None, metadata={"omit": "default"})
    uncertain_from: float = field(default=0.0, metadata={"min": 0.0, "omit": "default"})
    # The first step begins when ξ's distance outside the CoP region of both soles, plus
    # `momentum_gain` · ω L/(m g), is above `step_margin`; L is the angular momentum in the sense of
    # the fall: hips that turn the trunk already have given what they can.
    step_margin: float = number(0.0, "h")
    momentum_gain: float = number(0.0, "ω/(m g)", min=0.0)
    # While a motion moves, a first step begins, too, when the root turns away from it and is going
    # to be `turn_limit` [°] off in 0.7/ω; and `step_margin` grows by `crouch_margin` of what the
    # motion has the CoM below 0.95 h, less as the root is turned. 180 and 0 are without.
    turn_limit: float = number(60.0, "°", above=0.0, max=180.0, omit="default")
    crouch_margin: float = number(0.25, min=0.0, omit="default")
    restep_margin: float = number(0.01, "h")  # further steps begin when ξ is this far outside
    gain: float = number(1.0, above=0.0)  # k of p = ξ + k (ξ − ξ_ref)
    cop_overreach: float = number(0.0, "h", min=0.0)  # of p over its region: costs angular momentum
    region_fraction: float = number(0.95, above=0.0, max=1.0)  # of the CoP region that counts
    leg_length: float = number(0.96, "h", above=0.0)  # at touchdown: sets the CoM's height
    swing_com_drop: float = number(0.0, "h", min=0.0)  # the CoM is so much lower in a swing
    load_time: float = number(0.1, "1/ω", min=0.0)  # in which a foot takes up its load
    unload_time: float = number(0.04, "1/ω", min=0.0)  # in which a foot gives its load away
    double_support_time: float = number(0.15, "1/ω", min=0.0)  # least time between two steps
    torque_rate_limit: float = number(0.6, above=0.0)  # change in a tick, fraction of the limit
    root_accel: float = number(100.0, "ω²", above=0.0)  # most that the posture asks of the root
    swing_accel: float = number(100.0, "ω²", above=0.0)  # the same in a swing
    joint_accel: float = number(100.0, "ω²", above=0.0)  # and of the joints
    limits: StepLimits = field(default_factory=StepLimits)
    foothold: FootholdChoice = field(default_factory=FootholdChoice)
    feedback: StepFeedback = field(default_factory=StepFeedback)
    falls: dict[str, FallFeedback] = field(default_factory=dict)  # by direction of the fall
    pivot: PivotConfig = field(default_factory=PivotConfig, metadata={"omit": "default"})
    recentring: RecentringConfig = field(default_factory=RecentringConfig)
    swing: SwingTask = field(default_factory=SwingTask)
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)
    step_qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)

    RENAMED: ClassVar[Mapping[str, str]] = {
        "trigger": "step_margin", "spin": "momentum_gain", "again": "restep_margin",
        "hips": "cop_overreach", "share": "region_fraction", "stretch": "leg_length",
        "sink": "swing_com_drop", "ramp": "load_time", "unload": "unload_time",
        "pause": "double_support_time", "jump": "torque_rate_limit", "home": "recentring",
    }  # fmt: skip

    def __post_init__(self) -> None:
        if len({fall.angle for fall in self.falls.values()}) < len(self.falls):
            raise ValueError("falls: angles must differ")


@dataclass(frozen=True)
class IPMStepConfig(CaptureStepConfig):
    """The configuration of `capture-step`, with footholds by energy.

    Of `foothold` only `lateral_offset` counts. `time_min` = `time_max` = T.
    """

    kind: Literal["ipm-step"] = "ipm-step"  # type: ignore[assignment]
    arc: float = number(1.0, min=0.0, max=1.0)  # fraction of the height that a rigid leg gains
