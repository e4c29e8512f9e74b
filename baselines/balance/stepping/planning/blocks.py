"""The blocks that the kernels of this room work on: every array and number of a tick by its name.

`CaptureTick` holds the others. Numbers are in SI units. Arrays of one entry are numbers that
kernels write. The frame of the step has its origin at the stance sole and its x axis along the
heading of the step. ns is the number of soles, nv that of the degrees of freedom.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.baselines.whole_body.momentum_qp import Tick
from poise.baselines.whole_body.tick import ContactTick
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Kernel
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays


def zeros(dtype: type = float, **shapes: int | tuple[int, ...]) -> dict[str, Any]:
    """The members of a block that kernels write, by name: guarded zeros of these shapes."""
    return {name: guarded_zeros(shape, dtype) for name, shape in shapes.items()}


@dataclass(frozen=True, eq=False)
class RegionArrays(Block):
    """A `CopRegion`, in the frames of the soles."""

    alone: np.ndarray  # (ns, k, 2) corners of what each sole reaches alone [m]
    corners: np.ndarray  # (ns,) int: how many of them count
    middle: np.ndarray  # (ns, 2) their mean [m]
    sums: np.ndarray  # (5, n, 2) corners of what two reach, beside λ p_0 + (1 − λ) p_1 [m]
    support: np.ndarray  # (5, 48) how far these go along each direction [m]
    directions: np.ndarray  # (48, 2) unit vectors
    load_fractions: np.ndarray  # (5,) λ


@dataclass(frozen=True, eq=False)
class FeedbackArrays(Block):
    """K of a `StepFeedback` for one robot, the signals s, and Δ = K s; rows as in `feedback.py`."""

    always: np.ndarray  # (4, 9) K in m and s
    angles: np.ndarray  # (n,) directions of falls, rising [rad]
    added_at: np.ndarray  # (n, 4, 9) what is added to K there
    gains: np.ndarray  # (4, 9) K of the running step
    upright: np.ndarray  # (3,) the vertical at rest, in the root's axes
    height: float  # h [m]
    momentum_unit: float  # ω/(m g h) [1/(N·m·s)]
    pivot: np.ndarray  # (3, 2) of a plan, in a swing, on both feet: momentum [m/(N·m·s)], lean [m]
    lateral_fraction: float  # of these across the heading
    signals: np.ndarray  # (9,) s; kernels that plan set LATER_STEP and PHASE
    added: np.ndarray  # (4,) Δ [m, m, s, m]


@dataclass(frozen=True, eq=False)
class SwingArrays(Block):
    """A `Swing`: the reference of the swinging foot's sole."""

    reference: np.ndarray  # (3, 3) position, velocity, acceleration [m, s]
    foothold: np.ndarray  # (2,) [m]
    time: np.ndarray  # (1,) since lift-off [s]
    duration: np.ndarray  # (1,) from lift-off to touchdown [s]
    ground: np.ndarray  # (1,) height of the ground [m]
    time_offset: np.ndarray  # (1,) part of the duration that feedback and a policy added [s]
    apex: float  # height of the way above the ground [m]
    lift: float  # fraction of the duration in which the foot rises
    landing_speed: float  # [m/s]


#: entries of `Search.best`: foothold [m], time from now to touchdown [s], cost [m], and the part of
#: the time that feedback and a policy added [s]
BEST_X, BEST_Y, BEST_TIME, BEST_COST, BEST_OFFSET = range(5)


@dataclass(frozen=True, eq=False)
class Search(Block):
    """A search for a step: `StepLimits` and `FootholdChoice` in SI units, the step that is being
    weighed, and the best one so far."""

    state: StateArrays
    region: RegionArrays
    offsets: np.ndarray  # (13,) see `StepOffsets`
    feedback: FeedbackArrays
    heading: np.ndarray  # (2,) cosine and sine of the step's heading
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
    arc: float  # of an `EnergyPlanner`
    capture_point: np.ndarray  # (2,) ξ, and what turn and lean of the body add to it [m]
    corners: np.ndarray  # (k, 2) scratch: what the stance sole reaches [m]
    cop: np.ndarray  # (2,) the point of it that is nearest to ξ [m]
    start: np.ndarray  # (2,) where the foot is [m]
    foot: np.ndarray  # (1,) int: the foot that is to step
    time: np.ndarray  # (1,) from now to touchdown [s]
    foothold: np.ndarray  # (2,) for this foot and time [m]
    cost: np.ndarray  # (1,) of this foothold, without the price of its time [m]
    best: np.ndarray  # (5,) the best step, see BEST_X to BEST_OFFSET
    best_foot: np.ndarray  # (1,) int: its foot; −1: none yet
    foothold_rule: "Kernel[Search]"  # finds `foothold` and `cost`, as `capture_foothold` does


@dataclass(frozen=True, eq=False)
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
    stage: np.ndarray  # (1,) int: INACTIVE, SHIFTING, SWINGING or LOADING
    foot: np.ndarray  # (1,) int: the foot that goes back to its nominal place
    homing: np.ndarray  # (1,) int: 1 from the lift-off of that foot until a fall begins
    slip_time: np.ndarray  # (2,) for which each foot that should stand has had no hold [s]
    timer: np.ndarray  # (1,) for which it has been calm; while SHIFTING, since that began [s]
    capture_target: np.ndarray  # (2,) where ξ is brought [m]


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


@dataclass(frozen=True, eq=False)
class StepMemory(Block):
    """The memory of a controller that steps, from tick to tick."""

    steps: np.ndarray  # (1,) int: steps begun since the reset
    recovering: np.ndarray  # (1,) int: 1 from a step until the robot is calm in its nominal stance
    foot: np.ndarray  # (1,) int: the foot that stepped last; −1: none
    swinging: np.ndarray  # (1,) int: 1 while that foot is in the air, or about to leave
    level_frame: np.ndarray  # (3, 3) axes of a level sole along the heading of the step
    clock: np.ndarray  # (1,) since the last touchdown [s]
    load: np.ndarray  # (1,) that the foot bore when its step began [N]
    load_fraction: np.ndarray  # (1,) of this load that it still bears
    region: np.ndarray  # (2 n + 1, 2) CoP region of both soles since the last touchdown [m]
    corners: np.ndarray  # (1,) int: how many rows of it count; 0: it is not known
    moved: np.ndarray  # (1,) int: 1 once the motion has moved
    return_fraction: np.ndarray  # (1,) of the way from the stance's posture to the motion's


@dataclass(frozen=True, eq=False)
class CaptureTick(Block):
    """All that a tick of `CaptureStep` works on."""

    robot: RobotArrays
    state: StateArrays
    reference_in: TargetArrays  # what is asked of the controller
    reference_out: TargetArrays  # what the controller asks of its QPs in a step and after
    gains: StepGains
    search: Search
    swing: SwingArrays
    memory: StepMemory
    recentring: Recentring
    offsets: np.ndarray  # (13,) see `StepOffsets`
    on_first: ContactTick  # QP with the first sole in contact
    on_second: ContactTick  # QP with the second sole in contact
    on_both: ContactTick  # QP with both soles in contact
    standing: Tick  # QP with the feet in place, before the first step
    tau: np.ndarray  # (nv−6,) torques of the tick [N·m]
    vdot: np.ndarray  # (nv,) accelerations that they are to bring
    failures: np.ndarray  # (1,) int: ticks since the reset that could not be solved
    to_python: np.ndarray  # (1,) int: 1 where Python has to solve `standing`
    corners: np.ndarray  # (k, 2) scratch
    cloud: np.ndarray  # (n, 2) scratch
    pair: np.ndarray  # (2,) scratch
    vector: np.ndarray  # (3,) scratch
    standing_kernel: Kernel[Tick]  # `momentum_tick`; 0: Python calls another solver
    contact_kernel: Kernel[ContactTick]  # `contact_tick`
