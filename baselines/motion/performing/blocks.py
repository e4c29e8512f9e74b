"""The blocks of this package's kernels; in SI units."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.balance.references.footing import COLUMNS, Footing
from poise.baselines.balance.references.tempo import Pace
from poise.baselines.balance.stepping.planning.blocks import CaptureTick
from poise.baselines.balance.stepping.planning.units import in_si
from poise.baselines.controller import TargetArrays
from poise.envs.compiled.block import Block
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.mutable import Mutable

from .config import PerformConfig


@dataclass(eq=False)
class Performance(Block):
    """A `Footing` as compiled code reads it, gains, and how far the performance is."""

    knots: np.ndarray
    coeffs: np.ndarray
    switches: np.ndarray
    planted: np.ndarray
    pace: Pace  # of the motion's time, where it waits
    rows: Annotated[np.ndarray, 3, COLUMNS]  # position, velocity, acceleration; then by name,
    com: Annotated[np.ndarray, 3, 3]  # in the world
    root: Annotated[np.ndarray, 3, 3]  # rotation vector from standing
    places: Annotated[np.ndarray, 2, 3, 3]  # of the soles, in the world
    turns: Annotated[np.ndarray, 2, 3, 3]  # their rotation vectors from standing
    momentum_offset: Annotated[np.ndarray, 3, 2]  # δ, in the world
    gain: float
    margin: float  # [m]
    margin_both: float  # [m]
    rest_time: float  # [s]
    stance_error: float  # [m]
    load_time: float  # [s]
    unload_time: float  # [s]
    landing_speed: float  # [m/s] of a foot that is late
    clock: Mutable[float]  # since the reset [s]
    performing: Mutable[int]  # 1 while it follows the schedule; 0: it catches itself
    begun: Mutable[int]  # the phase whose foot lifted off last; 0: none did
    flying: Mutable[int]  # 1 during flight
    rested: Mutable[float]  # since both feet are down and the motion is left [s]
    left: Mutable[int]  # how often the planner of steps took over
    x: Mutable[float]  # of the motion's own frame in the world [m]
    y: Mutable[float]
    floor: Mutable[float]  # height of its ground [m]
    cos: Mutable[float]  # of its heading
    sin: Mutable[float]

    def clear(self) -> None:
        """Before the motion begins."""
        self.clock, self.rested = 0.0, 0.0
        self.begun, self.flying, self.left = 0, 0, 0
        self.performing = 1


def allocate_performance(
    footing: Footing, pace: Pace, config: PerformConfig, units: Units
) -> Performance:
    """The performance of a motion by a robot with these units, before it begins."""
    numbers = in_si(
        config, units, "gain", "margin", "margin_both", "rest_time", "stance_error", "load_time",
        "unload_time",
    )  # fmt: skip
    made = Performance.allocate(
        knots=footing.knots, coeffs=footing.coeffs, switches=footing.switches,
        planted=footing.planted, pace=pace,
        **numbers,
        **in_si(config.swing, units, "landing_speed"),
    )  # fmt: skip
    made.clear()
    return made


@dataclass(frozen=True, eq=False)
class PerformTick(Block):
    """All that a tick of `MotionStep` works on, while it performs a motion with steps."""

    capture: CaptureTick  # while it catches itself; it is asked for `resting`
    own: CaptureTick  # the same memory, with the QPs of the performance
    performance: Performance
    given: TargetArrays  # what is asked of the controller
    resting: TargetArrays  # that it stands, with the motion's trunk and arms
    legs: np.ndarray  # (k,) int: joints of the legs
    com_offset: float  # forward, of the CoM in standing [m]
    axes: np.ndarray  # (3, 3) of the swinging sole
