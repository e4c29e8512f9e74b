"""The schema of summary.json.

Impulses are N·s, lengths m, rates and gains fractions; an `Interval` is [low, high] of 95 %. null
means "no such value"; keys that a suite does not measure are left out.
"""

# without `from __future__ import annotations`: TypedDict must see which keys are required
from pathlib import Path
from typing import NotRequired, Required, TypedDict

from poise.configs.errors import ConfigError, shown
from poise.training.benchmarking.statistics.rates import SeedFigures

from .provenance import Circumstances
from .trial_figures import (
    Bound,
    Counts,
    Criterion,
    GustFigures,
    InMotion,
    Interval,
    MotionLevel,
    Number,
    PhaseJ50,
    Rate,
    ScenarioFigures,
    SustainedFigures,
    WalkLevel,
)

FORMAT = 2  # of a result's folder and of its summary


class Sector(TypedDict):
    """Random pushes within 22.5° of a direction.

    `fraction50` is their J50, as a fraction of the limit.
    """

    direction: float
    trials: int
    recovered: int
    fraction50: float
    fraction50_ci95: Interval
    fraction50_bound: Bound


class Direction(TypedDict, total=False):
    """J50 and J90 of a direction, over the limits of ankles and of steps."""

    direction: Required[float]
    trials: Required[int]
    recovered: Required[int]
    j50: Required[float]
    j50_ci95: Required[Interval]
    ankle_limit: Required[float]
    eta: Required[float]
    j50_bound: Bound
    j50_per_mass: float
    j90: Number
    j90_ci95: Interval
    eta_ci95: Interval
    eta90: Number
    step_reach: float
    step_length: float
    step_time: float
    step_limit_1: float
    step_limit_2: float
    step_limit_inf: float
    step_share_1: float
    step_share_2: float
    step_share_inf: float


class EnvelopeFigures(TypedDict, total=False):
    """J50 over the directions, of pushes of `push_duration` [s], which older results lack.

    `j50_mean_bound` is the kind of bound that J50 is in every direction, see `LogisticFit.bound`.
    """

    push_duration: float
    j50_mean: float
    j50_mean_ci95: Interval
    j50_mean_bound: Bound
    j50_mean_per_mass: float
    j50_min: float
    j90_mean: Number
    j50_bounded: int
    eta_mean: float
    eta_mean_ci95: Interval
    eta_min: float
    directions: list[Direction]
    step_share_1_mean: float
    step_share_2_mean: float
    step_share_inf_mean: float


class Level(Rate):
    """A level of a factor; `lost` and `won` are relative to the standard case."""

    level: str
    standard: bool
    lost: int
    won: int
    p_mcnemar: float


class Factor(TypedDict):
    """A factor that is varied alone; `standard` is its level in the standard case."""

    factor: str
    standard: str
    levels: list[Level]


class MarginFigures(TypedDict, total=False):
    """EUROBENCH's stability margin in a direction."""

    direction: Required[float]
    impulse: Number
    force: float
    force_normalised: float
    energy: float
    energy_normalised: float
    largest_tried: bool


class Eurobench(TypedDict):
    """EUROBENCH's indicators of simulated subjects."""

    body_sway_mean: Number
    recovery_time_mean: Number
    recovery_time_trials: int
    trials: int
    margins: list[MarginFigures]


class RealismLevel(Rate, total=False):
    """The parts of a suite at a realism level.

    Rates are of random pushes, if there are any, else of all trials. `stood` counts the unpushed
    trials without a fall. `j50_kept` is the J50 over that of the suite's own level, which comes
    first; null where either is only a bound.
    """

    level: Required[str]
    stood: int
    unpushed: int
    j50_mean: float
    j50_mean_ci95: Interval
    j50_mean_bound: Bound
    j50_bounded: int
    j50_kept: Number
    j50_kept_ci95: Interval | None
    torque_variation_median: Number
    energy_median: Number


class Fractions(TypedDict, total=False):
    """J50 of the random pushes, as a fraction of the limit."""

    fraction_of: str
    fraction50: float
    fraction50_ci95: Interval
    fraction50_bound: Bound
    sectors: list[Sector]


class Loss(TypedDict):
    """The number of trials lost by a cause, see `training/benchmarking/diagnosis`."""

    cause: str
    trials: int


class Entry(Counts, EnvelopeFigures, Fractions, total=False):
    """A controller.

    The counts are of the rated part, else of all trials; of pushed walks, of those common to all
    controllers. `evaluated` counts all trials, `errors` those in which the controller raised,
    `fell_before_push` those that ended before the first push, if any.
    `losses` lists the causes, the most frequent first. J50, ranking, pairs and losses use the
    `criterion`; older results, which lack it, use "recovered". `stand_ins` counts the trials in
    which another controller ran in place of the named one, see its `uncertain`.
    """

    evaluated: Required[int]
    errors: Required[int]
    fell_before_push: int
    criterion: Criterion
    losses: list[Loss]
    tick_us: Number
    fingerprint: str
    timesteps: int
    stand_ins: dict[str, int]
    factors: list[Factor]
    eurobench: Eurobench
    walks: list[WalkLevel]
    phases: list[PhaseJ50]
    motions: list[MotionLevel]
    levels: list[RealismLevel]
    in_motion: list[InMotion]
    scenarios: list[ScenarioFigures]
    sustained: list[SustainedFigures]
    gusts: GustFigures


class Paired(TypedDict, total=False):
    """Counts of the identical trials of both controllers."""

    both: int
    only_a: int
    only_b: int
    neither: int
    p_mcnemar: float
    rate_gain: float
    rate_gain_ci95: Interval


class DirectionGain(TypedDict):
    """The gain in one direction."""

    direction: float
    j50_gain: Number
    j50_gain_ci95: Interval


class Pair(Paired, total=False):
    """Controller b against a on the rated trials, and on all common trials."""

    a: Required[str]
    b: Required[str]
    all: Paired | None
    identical: bool
    j50_gain: Number
    j50_gain_ci95: Interval | None
    directions: list[DirectionGain]


class SeedGroup(TypedDict, total=False):
    """Figures of runs of one configuration that differ only in the seed."""

    name: Required[str]
    members: Required[list[str]]
    seeds: Required[list[int]]
    j50_mean: SeedFigures
    eta: SeedFigures
    recovered: SeedFigures


Curves = TypedDict(
    "Curves",
    {"directions": list[float], "1": list[float], "2": list[float], "inf": list[float]},
)


class StepCurves(TypedDict):
    """The impulses that 1, 2 and any number of steps can stop, of controllers with equal step
    limits."""

    controllers: list[str]
    steps: dict[str, float]
    curves: Curves


class RobotFigures(TypedDict):
    """The robot's figures; its ankle limit is [direction, N·s] of a 0.1 s push."""

    name: str
    mass: float
    height_com: float
    omega: float
    human_com_height: float
    ankle_limit: list[tuple[float, float]]


class Summary(Circumstances):
    """summary.json; `realism` is the suite's level unless ideal, `physics` the engine unless
    MuJoCo."""

    realism: NotRequired[str]
    physics: NotRequired[str]
    format: int
    suite: str
    seed: int
    robot: RobotFigures
    rated: str | None
    scale: str
    reference: str
    ranking: list[str]
    controllers: dict[str, Entry]
    pairs: list[Pair]
    step_limits: list[StepCurves]
    seeds: list[SeedGroup]


def check_format(found: object, path: Path) -> None:
    """Raise ConfigError for a file of another format than `FORMAT`."""
    if found == FORMAT:
        return
    other = "an older Poise" if found in (None, 1) else f"format {shown(found)}"
    raise ConfigError(
        f"is of {other}, this one reads format {FORMAT}: run it again in another folder, "
        "or with --overwrite",
        source=path,
        field="format",
    )


def both_ends(interval: Interval | None) -> tuple[float, float] | None:
    """Both ends of an interval, or None where one is open."""
    if interval is None or interval[0] is None or interval[1] is None:
        return None
    return interval[0], interval[1]
