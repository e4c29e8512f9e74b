"""The interface of a controller that walks: the command that it follows, and its gait."""

from typing import Protocol, runtime_checkable

from poise.baselines.balance.stepping.planning.blocks import StepMemory
from poise.envs.terrain.terrain import Terrain

from .planner.blocks import Gait
from .planner.command import GaitCommand, command_of
from .planner.reach import Reach


@runtime_checkable
class WalkingController(Protocol):
    """The further members of a controller that walks.

    `gait` and `memory` are the blocks that its compiled ticks work on. Compiled code may write
    `gait.command`, which is `command` as an array.
    """

    command: GaitCommand  #: that it follows; may be set at any time
    gait: Gait  #: with the command, and the velocity that follows it
    memory: StepMemory  #: of its steps

    @property
    def walking(self) -> bool:
        """True from the first shift of weight until the walk has stopped."""


class Commanded:
    """The command of a controller whose `gait` holds it as an array."""

    gait: Gait

    @property
    def command(self) -> GaitCommand:
        """The velocity and turn that are asked for; may be set at any time."""
        return command_of(self.gait.command)

    @command.setter
    def command(self, command: GaitCommand) -> None:
        self.gait.command[:] = command.array()


@runtime_checkable
class LimitedWalker(Protocol):
    """The members of a walking controller with ranges of commands."""

    def check_command(self, command: GaitCommand) -> None:
        """Raise ConfigError with these limits for a command out of range."""


@runtime_checkable
class ReachingWalker(Protocol):
    """What a controller that walks and follows every part of a command has."""

    @property
    def reach(self) -> Reach:
        """The ranges of its commands, on the terrain that it assumes."""


@runtime_checkable
class ClipWalker(Protocol):
    """What a controller that walks clips has: environments call it with their motion."""

    def take_clip(self, walked: bool) -> None:
        """Take that a clip is walked, whose trunk and arms are to be kept, or none."""


@runtime_checkable
class TerrainWalker(Protocol):
    """What a controller that plans its steps on a terrain has: environments set it at the reset."""

    terrain: Terrain  #: that it assumes
