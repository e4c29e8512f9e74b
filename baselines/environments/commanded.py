"""Environments whose controller may walk: it follows commands, one after the other."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from poise.baselines.controller import BaseController
from poise.baselines.registry import walking_controllers
from poise.baselines.walking.controller import (
    LimitedWalker,
    ReachingWalker,
    TerrainWalker,
    WalkingController,
)
from poise.baselines.walking.planner.command import GaitCommand, command_of
from poise.baselines.walking.planner.reach import Reach
from poise.baselines.walking.schedule import (
    Follower,
    TimedCommand,
    empty_timetable,
    follow_timetable,
    parse_commands,
)
from poise.configs.errors import ConfigError
from poise.configs.schema import build, to_dict
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.start import RESET_OPTIONS


class FollowingEnv(BalanceEnv):
    """Base of environments whose robot is to follow a velocity: their success and their info."""

    def _commanded(self) -> np.ndarray:
        """Return the command (3,): ahead, left [m/s], turn [rad/s]."""
        raise NotImplementedError

    def _velocity_error(self) -> np.ndarray:
        """Return the velocity minus the command (3,)."""
        raise NotImplementedError

    @property
    def recovered(self) -> bool:
        """Not fallen, as the benchmark judges a walk; at rest, where nothing is commanded.

        A tracking error is charged by the reward, and is "velocity_error" of `info`.
        """
        return not self.fallen if self._commanded().any() else super().recovered

    def info(self) -> dict[str, Any]:
        """The entries of the environment without a command, the command and the error from it."""
        return {
            **super().info(),
            "command": self._commanded().copy(),
            "velocity_error": self._velocity_error().copy(),
        }


class CommandedEnv(BalanceEnv):
    """Base of environments around a controller, which may be one that follows commands."""

    option_names = (*RESET_OPTIONS, "command")  #: of `reset`

    def _take_walker(self, controller: BaseController) -> None:
        """Take the controller that follows commands, if it walks."""
        decides = controller.unwrapped
        self._walker = decides if isinstance(decides, WalkingController) else None
        #: (8,) its command; None where it follows none
        self._orders: np.ndarray | None = getattr(decides, "orders", None)
        if self._walker is not None:
            self._orders = self._walker.gait.command
        self._decides = type(decides).__name__
        self._timetable = empty_timetable()

    def _take_orders(self, orders: np.ndarray, name: str) -> None:
        """Take the array (8,) of what is commanded where no controller walks, but `name` itself."""
        self._walker, self._orders, self._decides = None, orders, name
        self._timetable = empty_timetable()

    @property
    def command(self) -> GaitCommand | None:
        """The command of a controller now; None for a controller that follows none.

        Setting it ends the commands of the reset. Raises ConfigError for a controller that does not
        walk, and for a command out of the robot's range. An external policy is commanded
        velocity and turn alone.
        """
        if self._walker is not None:
            return self._walker.command
        return None if self._orders is None else command_of(self._orders)

    @command.setter
    def command(self, command: GaitCommand | Mapping[str, float]) -> None:
        if not isinstance(command, GaitCommand):
            command = build(GaitCommand, to_dict(command), "command")
        self.check_command(command)
        self._timetable.clear()
        if self._walker is not None:
            self._walker.command = command
        else:
            self._expect_orders("environment")[:] = command.array()

    def check_command(self, command: GaitCommand) -> None:
        """Raise ConfigError with the robot's limits for a command that is out of its reach, and
        for a controller that does not walk."""
        self._expect_orders("environment")
        check_reach(self._walker, command)

    @property
    def reach(self) -> Reach | None:
        """The ranges of its commands; None where the controller does not walk, or has none."""
        return self._walker.reach if isinstance(self._walker, ReachingWalker) else None

    @property
    def transfer_time(self) -> float | None:
        """T_d on both feet between two steps [s]; None for a controller that plans none."""
        return None if self._walker is None else float(self._walker.gait.transfer_time)

    def _expect_orders(self, source: str) -> np.ndarray:
        """Return the controller's command (8,); raise ConfigError for one that does not walk."""
        if self._orders is None:
            raise ConfigError(
                f"the controller {self._decides} does not walk; give one that does",
                source=source,
                field="command",
                choices=walking_controllers(),
            )
        return self._orders

    def _commands(self, options: Mapping[str, Any]) -> Sequence[TimedCommand]:
        """The commands of an episode that begins with these options."""
        return parse_commands(options["command"]) if "command" in options else ()

    def _begin_walk(self, options: Mapping[str, Any]) -> None:
        """Tell the controller what it stands on, where it plans its steps, and its commands."""
        terrain, walker = self.simulation.robot.terrain, self._walker
        if isinstance(walker, TerrainWalker) and walker.terrain != terrain:
            walker.terrain = terrain
            self._unbind()
        commands = self._commands(options)
        if "command" in options:
            self._expect_orders("reset")
            for command in commands:
                check_reach(walker, command)
        self._timetable.fill(commands)
        if self._orders is not None:
            follow_timetable(self._follower(self._orders))

    def _follower(self, orders: np.ndarray) -> Follower:
        """Return the block that writes the controller's commands."""
        clock = self.simulation.clock
        return Follower(self._timetable, clock, self.arrays.timestep, orders)


def check_reach(walker: WalkingController | None, command: GaitCommand) -> None:
    """Raise ConfigError for a command outside the ranges of a controller that has them."""
    if isinstance(walker, LimitedWalker):
        walker.check_command(command)
