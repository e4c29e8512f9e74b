"""The blocks of this package's kernels: every array and number of a tick by its name.

`CaptureTick` holds the others. Numbers are in SI units. The frame of the step has its origin at the
stance sole and its x axis along the heading of the step. ns is the number of soles, nv that of the
degrees of freedom.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.balance.references.targets import Offsets
from poise.baselines.controller import TargetArrays
from poise.baselines.whole_body.momentum_qp import Tick
from poise.baselines.whole_body.tick import ContactTick
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Kernel
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .cop_region import CopRegion
from .feedback import FeedbackArrays
from .swing import Swing


@dataclass(eq=False)
class Search(Block):
    """A search for a step: `StepLimits` and `FootholdChoice` in SI units, the step that is being
    weighed, and the best one so far."""

    state: StateArrays
    region: CopRegion
    offsets: Offsets
    feedback: FeedbackArrays
    heading: Annotated[np.ndarray, 2]  # cosine and sine of the step's heading
    foot_sign: np.ndarray  # (2,) 1 for the left foot, −1 for the right one
    height: float  # h [m]
    ahead: float  # limits of the foothold in the frame of the step [m]
    behind: float
    width_min: float
    width_max: float
    speed: float  # [m/s]
    side_speed: float
    time_min: float  # [s]
    time_max: float
    sagittal_offset: float  # [m]
    lateral_offset: float
    margin: float  # [m]
    time_price: float  # [m/s]
    arc: float  # of an `IPMStep`
    capture_point: Annotated[np.ndarray, 2]  # ξ, and what turn and lean of the body add to it [m]
    corners: Annotated[np.ndarray, "k", 2]  # scratch: what the stance sole reaches [m]
    cop: Annotated[np.ndarray, 2]  # the point of it that is nearest to ξ [m]
    start: Annotated[np.ndarray, 2]  # where the foot is [m]
    foot: Mutable[int]  # the foot that is to step
    time: Mutable[float]  # from now to touchdown [s]
    foothold: Annotated[np.ndarray, 2]  # for this foot and time [m]
    cost: Mutable[float]  # of this foothold, without the price of its time [m]
    best_x: Mutable[float]  # foothold of the best step [m]
    best_y: Mutable[float]
    best_time: Mutable[float]  # from now to its touchdown [s]
    best_cost: Mutable[float]  # [m]
    best_offset: Mutable[float]  # part of its time that feedback and a policy added [s]
    best_foot: Mutable[int]  # its foot; −1: none yet
    foothold_rule: "Kernel[Search]"  # finds `foothold` and `cost`, as `capture_foothold` does


@dataclass(eq=False)
class Recentring(Block):
    """A `RecentringConfig` in SI units, and how far the robot is on its way."""

    distance: float  # [m]
    calm_speed: float  # [m/s]
    calm_cosine: float  # of the largest tilt that is calm
    calm_time: float  # [s]
    capture_offset: float  # [m]
    counterbalance: float
    arrival_radius: float  # [m]
    shift_time_max: float  # [s]
    swing_time: float  # [s]
    margin: float  # [m]
    cop_distance: float  # [m]
    nominal: np.ndarray  # (2,) from the second sole to the first one in the nominal stance [m]
    stage: Mutable[int]  # INACTIVE, SHIFTING, SWINGING or LOADING
    foot: Mutable[int]  # the foot that goes back to its nominal place
    homing: Mutable[int]  # 1 from the lift-off of that foot until a fall begins
    slip_time: Annotated[np.ndarray, 2]  # for which each foot that should stand has had no hold [s]
    timer: Mutable[float]  # for which it has been calm; while SHIFTING, since that began [s]
    capture_target: Annotated[np.ndarray, 2]  # where ξ is brought [m]


#: of `StepGains` those that the legs' limits give, in a step and in a gait
LEG_NUMBERS = ("leg_length", "root_accel", "swing_accel", "joint_accel")
#: of `StepLimits` those that a `Search` has
SEARCHED = (
    "ahead", "behind", "width_min", "width_max", "speed", "side_speed", "time_min", "time_max",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class StepGains(Block):
    """The gains of a `CaptureStepConfig` in SI units."""

    step_margin: float  # [m]
    crouch_margin: float  # [m] more for a motion that crouches by 1 m
    turn_limit: float  # of the root against the motion's [rad]
    momentum_gain: float  # [m per N·m·s]
    restep_margin: float  # [m]
    gain: float  # k of p = ξ + k (ξ − ξ_ref)
    cop_overreach: float  # [m]
    leg_length: float  # [m]
    swing_com_drop: float  # [m]
    load_time: float  # [s]
    unload_time: float  # [s]
    double_support_time: float  # [s]
    root_accel: float  # [rad/s²]
    swing_accel: float  # [rad/s²]
    joint_accel: float  # [rad/s²]
    rest_ahead: float  # of ξ_ref from the middle of the region of both soles [m]
    period: float  # of a tick [s]


@dataclass(eq=False)
class StepMemory(Block):
    """The memory of a controller that steps, from tick to tick."""

    steps: Mutable[int]  # steps begun since the reset
    recovering: Mutable[int]  # 1 from a step until the robot is calm in its nominal stance
    foot: Mutable[int]  # the foot that stepped last; −1: none
    swinging: Mutable[int]  # 1 while that foot swings, or is about to leave
    level_frame: Annotated[np.ndarray, 3, 3]  # axes of a level sole along the heading of the step
    clock: Mutable[float]  # since the last touchdown [s]
    load: Mutable[float]  # that the foot bore when its step began [N]
    load_fraction: Mutable[float]  # of this load that it still bears
    region: Annotated[np.ndarray, "2n+1", 2]  # CoP region of both soles since touchdown [m]
    corners: Mutable[int]  # how many rows of it count; 0: it is not known
    moved: Mutable[int]  # 1 once the motion has moved
    return_fraction: Mutable[float]  # of the way from the stance's posture to the motion's


@dataclass(eq=False)
class CaptureTick(Block):
    """All that a tick of `CaptureStep` works on."""

    robot: RobotArrays
    state: StateArrays
    reference_in: TargetArrays  # what is asked of the controller
    reference_out: TargetArrays  # what the controller asks of its QPs in a step and after
    gains: StepGains
    search: Search
    swing: Swing
    memory: StepMemory
    recentring: Recentring
    offsets: Offsets
    on_first: ContactTick  # QP with the first sole in contact
    on_second: ContactTick  # QP with the second sole in contact
    on_both: ContactTick  # QP with both soles in contact
    standing: Tick  # QP with feet fixed, before the first step
    tau: np.ndarray  # (nv−6,) torques of the tick [N·m]
    vdot: np.ndarray  # (nv,) accelerations that they are to bring
    failures: Mutable[int]  # ticks since the reset that could not be solved
    corners: Annotated[np.ndarray, "k", 2]  # scratch
    cloud: Annotated[np.ndarray, "n", 2]  # scratch
    pair: Annotated[np.ndarray, 2]  # scratch
    vector: Annotated[np.ndarray, 3]  # scratch
    standing_kernel: Kernel[Tick]  # `momentum_tick`
    contact_kernel: Kernel[ContactTick]  # `contact_tick`
