"""Figures of a controller's trials in summary.json: counts, and means of walks and motions.

Impulses are N·s, lengths m, rates fractions; an `Interval` is [low, high] of 95 %.
"""

# without `from __future__ import annotations`: TypedDict must see which keys are required
from typing import Literal, NotRequired, TypedDict

Number = float | None
Interval = tuple[Number, Number]
Bound = Literal["lower", "upper"] | None  # where a fit is only a bound


#: what counts as success in J50, rankings and pairs: of walks no fall, otherwise recovery
Criterion = Literal["not fallen", "recovered"]
NOT_FALLEN: Criterion = "not fallen"
RECOVERED: Criterion = "recovered"


class Rate(TypedDict):
    """Numbers and rates of recovered trials and of trials without a fall.

    Older results lack the trials without a fall or an error of some parts.
    """

    trials: int
    recovered: int
    recovered_rate: float
    recovered_ci95: Interval
    fallen: NotRequired[int]
    never_fell_rate: NotRequired[float]
    never_fell_ci95: NotRequired[Interval]


class RisingFigures(TypedDict, total=False):
    """Robots that were down, after a fall or from the start, and the share that got up again."""

    downs: int
    up_again_rate: float
    up_again_ci95: Interval
    up_time_median: Number


class Counts(Rate, RisingFigures, total=False):
    """Counts of outcomes, and medians of recorded figures."""

    recovered_with_step: int
    recovered_in_place: int
    steps_mean: Number
    steps_max: Number
    solver_failures: int
    solver_failures_recovered: int
    recovery_time_median: Number
    max_com_median: Number
    max_capture_median: Number
    min_cop_margin_median: Number
    max_slide: Number
    energy_median: Number
    mean_power_median: Number
    torque_variation_median: Number
    peak_torque_median: Number
    mean_abs_action: Number
    mean_abs_action_max: Number
    com_drift_max: Number
    foot_drift_max: Number
    unpushed_lean_max: Number
    root_force_max: Number


class WalkMeans(TypedDict, total=False):
    """Means over the trials of a level, see `Outcome`."""

    own_speed_error: Number
    own_turn_error: Number
    last_speed_error: Number
    last_turn_error: Number

    speed_ahead: Number
    speed_left: Number
    turn_rate: Number
    speed_error: Number
    speed_error_rms: Number
    turn_error_rms: Number
    step_length: Number
    step_width: Number
    step_time: Number
    swing_time: Number
    step_clearance: Number
    step_error: Number
    yaw_momentum: Number
    cost_of_transport: Number
    positive_cost_of_transport: Number
    knee_mean: Number
    knee_peak: Number
    circle_error: Number
    foot_slide: Number
    edge_contacts: Number
    surfaces_passed: Number


class StepsAsCommanded(TypedDict, total=False):
    """The rate of walks without a fall whose steps are within 10 % of each commanded step
    parameter."""

    steps_as_commanded_rate: float


class WalkLevel(Rate, StepsAsCommanded, WalkMeans, total=False):
    """Walking trials with one command, one course or one kind of kick."""

    part: str
    level: str
    minutes: float
    falls_per_minute: Number
    falls_per_minute_ci95: Interval | None


class MotionMeans(TypedDict, total=False):
    """Means over the trials without a fall, see `Outcome`."""

    joint_rms: Number
    body_error: Number
    body_error_root: Number
    body_error_last: Number
    com_error: Number
    sole_slide: Number
    motion_delay: Number
    swing_error: Number
    placement_error: Number
    support_slide: Number
    interruptions: Number
    mean_power: Number


class MotionLevel(MotionMeans):
    """A motion, pushed by a share of J50; `motion` is null for all motions together."""

    motion: str | None
    share: float
    trials: int
    fallen: int
    fallen_rate: float
    fallen_ci95: Interval
    solver_failures: int
    steps_mean: Number


class InMotion(TypedDict):
    """J50 in a motion, as a share of the J50 by which its pushes were chosen.

    `over_standing` is its ratio to the same figure of standing, null where standing was not
    measured. `motion` is null for the mean over all motions, "standing" for standing alone.
    """

    motion: str | None
    trials: int
    recovered: int
    share50: float
    share50_ci95: Interval
    share50_bound: Bound
    over_standing: Number
    over_standing_ci95: Interval | None


class PhaseJ50(TypedDict):
    """Pushes that begin in one eighth of a stride; `phase` is its middle, 0 at left touchdown."""

    phase: float
    trials: int
    recovered: int
    j50: float
    j50_ci95: Interval
    j50_bound: Bound


class ScenarioFigures(Counts):
    """Trials of a scenario, with the mean speed of a walk [m/s], see `Outcome`."""

    scenario: str
    speed_ahead: NotRequired[Number]


class SustainedFigures(Counts):
    """Sustained pushes, of all profiles or of one.

    F50 [N] is the peak force that half of the trials resist without a fall.
    """

    profile: str
    f50: float
    f50_ci95: Interval
    f50_bound: Bound
    f50_per_mass: float


class GustFigures(Counts):
    """Trials of up to `pushes` gusts: the mean number survived, and the trials that survive the
    first gust."""

    pushes: int
    survived_mean: float
    survived_ci95: Interval
    first_survived: int
