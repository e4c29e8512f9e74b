"""The blocks that the kernels of this room work on; SI units, arrays of one entry are numbers."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.references.footing import COLUMNS, Footing
from poise.baselines.balance.references.tempo import Pace
from poise.baselines.balance.stepping.planning.blocks import CaptureTick
from poise.baselines.balance.stepping.planning.units import in_si
from poise.baselines.controller import TargetArrays
from poise.envs.compiled.block import Block
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.memory import guarded_zeros

from .config import PerformConfig

#: of `Performance.frame`: where the motion's own frame is in the world, its ground and its heading
X, Y, GROUND, COS, SIN = range(5)


@dataclass(frozen=True, eq=False)
class Performance(Block):
    """A `Footing` as compiled code reads it, gains, and how far the performance is."""

    knots: np.ndarray
    coeffs: np.ndarray
    switches: np.ndarray
    planted: np.ndarray
    pace: Pace  # of the motion's time, where it waits
    samples: np.ndarray  # (3, 20) of the tick: position, velocity and acceleration, in the world
    gain: float
    margin: float  # [m]
    margin_both: float  # [m]
    rest_time: float  # [s]
    stance_error: float  # [m]
    load_time: float  # [s]
    unload_time: float  # [s]
    landing_speed: float  # [m/s] of a foot that is late
    clock: np.ndarray  # (1,) since the reset [s]
    performing: np.ndarray  # (1,) int: 1 while it follows the schedule; 0: it catches itself
    begun: np.ndarray  # (1,) int: the phase whose foot lifted off last; 0: none did
    flying: np.ndarray  # (1,) int: 1 while both feet are in the air
    rested: np.ndarray  # (1,) since both feet are down and the motion is left [s]
    left: np.ndarray  # (1,) int: how often the planner of steps took over
    frame: np.ndarray  # (5,) see X to SIN

    def clear(self) -> None:
        """Before the motion begins."""
        for array in (self.clock, self.begun, self.flying, self.rested, self.left):
            array[0] = 0
        self.performing[0] = 1


def allocate_performance(
    footing: Footing, pace: Pace, config: PerformConfig, units: Units
) -> Performance:
    """The performance of a motion by a robot with these units, before it begins."""
    whole = np.int64
    made = Performance(
        footing.knots, footing.coeffs, footing.switches, footing.planted, pace,
        samples=guarded_zeros((3, COLUMNS)),
        **in_si(Performance, config, units),
        **in_si(Performance, config.swing, units),
        clock=guarded_zeros(1),
        performing=guarded_zeros(1, whole),
        begun=guarded_zeros(1, whole),
        flying=guarded_zeros(1, whole),
        rested=guarded_zeros(1),
        left=guarded_zeros(1, whole),
        frame=guarded_zeros(5),
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
