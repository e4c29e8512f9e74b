"""The blocks that the kernels of walking work on; in SI units."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.balance.stepping.planning.blocks import CaptureTick, StepMemory
from poise.baselines.balance.stepping.planning.swing import Swing
from poise.baselines.walking.models.reference import Reference
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.mutable import Mutable


@dataclass(eq=False)
class Treads(Block):
    """The surfaces on which footholds are given, and how the foot swings between them."""

    surfaces: np.ndarray  # (n,) see `surface_arrays`; none: footholds are free
    margin: float  # [m]
    least_step: float  # [m]
    approach: float  # [m]
    highest: float  # [m]
    clearance: float  # [m]
    hold_up: float  # of a swing that goes up [of the swing]
    hold_down: float
    rise: float
    rise_down: float
    lower: float
    lower_down: float
    arrive: float
    lean: float  # [rad/m]
    lean_from: float  # [m]
    leaning: Mutable[float]  # of the trunk ahead, now [rad]
    left: Annotated[np.ndarray, 3]  # where the swinging foot lifted off [m]
    aim: Mutable[int]  # the surface that the step goes to
    target: Mutable[float]  # height of the foothold that is being weighed [m]
    room: Annotated[np.ndarray, 2]  # scratch: from a sole's point to its heel and its toes [m]


@dataclass(eq=False)
class Gait(Block):
    """A `GaitConfig` in SI units, the command, and how far the walk is."""

    step_time: float  # T, from lift-off to touchdown, unless the command says it [s]
    transfer_time: float  # T_d, on both feet [s]
    width: float  # W, unless the command says it [m]
    height: float  # of the CoM [m]
    acceleration: float  # [m/s²]
    turn_acceleration: float  # [rad/s²]
    correction: float
    correction_limit: float  # [m/s]
    time_price: float  # [m/s]
    transfer_gain: float
    start_radius: float  # [m]
    start_time: float  # [s]
    speed_margin: float  # [m/s]
    time_min: float  # of a step, whatever the command says [s]
    lower: float  # from when a swinging foot comes down [of the swing]; 0: once it is up
    catch: float  # the miss of ξ from which the walk is given up [m]; 0: never
    calm_time: float  # on both feet, after which it goes on [s]
    command: np.ndarray  # (8,) see `GaitCommand.array`; those that follow are its entries
    commanded_step_time: Mutable[float]  # [s]; 0 here and below: the gait's own
    asked_step_time: Mutable[float]  # [s] the same, of this step
    commanded_width: Mutable[float]  # [m]
    commanded_clearance: Mutable[float]  # [m]
    commanded_arm_swing: Mutable[float]  # [rad]
    commanded_step_length: Mutable[float]  # [m]
    velocity: Annotated[np.ndarray, 3]  # ahead, left, turn, which follow the command
    error: Annotated[np.ndarray, 2]  # what the sum of the velocity's errors adds to it [m/s]
    planned: Annotated[np.ndarray, 2]  # the velocity with it [m/s]
    yaw: Mutable[float]  # of the heading [rad]
    walking: Mutable[int]  # 1 from the first shift of weight until the walk has stopped
    starting: Mutable[int]  # 1 until the first foot lifts off
    clock: Mutable[float]  # since both feet are down [s]
    cop: Annotated[np.ndarray, 2]  # that was asked for last on one foot [m]
    miss: Mutable[float]  # of ξ at touchdown, which that CoP leaves [m]
    caught: Mutable[int]  # 1 from when the walk was given up until it goes on
    middle: Annotated[np.ndarray, 2]  # between the soles at the last touchdown [m]
    step_clock: Mutable[float]  # since then [s]; < 0: there was none
    treads: Treads


@dataclass(eq=False)
class Arms(Block):
    """The joints that swing the arms; as many arms as feet, none where `scales` are zero."""

    scales: np.ndarray  # (2, nj) of the arm on the side of each foot: about the robot's left axis
    weight: np.ndarray  # (nv,) of the posture in the QP while the arms swing as commanded
    free_weight: np.ndarray  # (nv,) else
    least_step: float  # [m] for the whole swing; less where steps are shorter
    swinging: Mutable[int]  # 1 while they swing as commanded


@dataclass(frozen=True, eq=False)
class WalkTick(Block):
    """All that a tick of `Walk` works on."""

    capture: CaptureTick  # while it stands, and catches falls from there
    walk: CaptureTick  # the same memory, with the QPs, the swing and the limits of the gait
    gait: Gait
    reference: Reference  # inputs and outputs of the gait's model
    model: Program  # its kernel
    arms: Arms
    constant_height: int  # 1: the gait's own height holds, and no model is asked
    stance: Annotated[np.ndarray, 2]  # scratch: the middle of what the stance sole reaches [m]
    swinging: Annotated[np.ndarray, 2]  # scratch: the same of the other one

    @property
    def memory(self) -> StepMemory:
        """The memory of its steps."""
        return self.capture.memory

    @property
    def swing(self) -> Swing:
        """The way of the swinging foot."""
        return self.capture.swing
