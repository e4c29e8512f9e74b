"""The compiled parts of a tick around a controller that is called from Python.

Each takes one block: looking up the type of a block costs a call some 5 µs.
"""

from dataclasses import dataclass

import numpy as np

from poise.envs.arrays import Plant, RobotArrays
from poise.envs.block import Block
from poise.envs.episode import EpisodeArrays, record_tick
from poise.envs.jit import compiled
from poise.envs.kinematics import StateArrays

from .controller import TargetArrays
from .targets import Motion, update_targets


@dataclass(frozen=True, eq=False)
class Aim(Block):
    """What `update_targets` works on."""

    robot: RobotArrays
    state: StateArrays
    clock: np.ndarray  # (1,) int
    motion: Motion
    com_offset: float  # [m]
    residual: np.ndarray  # (≥ 9,)
    targets: TargetArrays


@compiled
def aim(block: Aim):
    """Targets of this tick."""
    update_targets(
        block.robot, block.state, block.motion, block.clock[0] * block.robot.timestep,
        block.com_offset, block.residual, block.targets,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Record(Block):
    """What `record_tick` works on."""

    robot: RobotArrays
    state: StateArrays
    plant: Plant
    period: float  # [s]
    episode: EpisodeArrays


@compiled
def record(block: Record):
    """Account for the torques in `plant.ctrl`."""
    record_tick(block.robot, block.state, block.plant.ctrl, block.period, block.episode)
