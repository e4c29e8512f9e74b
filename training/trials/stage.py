"""What a process needs to play trials: who plays where."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from poise.envs.balance.config import StartNoise
from poise.envs.robots.robot import Robot, load_robot

from .players import Player, load_player


@dataclass(frozen=True)
class Stage:
    """Where all trials are played.

    Attributes:
        robot: name or path.
        duration: of a trial [s].
        noise: of the start.
    """

    robot: str | Path
    duration: float
    noise: StartNoise

    def load(self, controller: str, robot: Robot | None = None) -> Player:
        """The player of this name here; `robot` if it is loaded. Raises ConfigError."""
        robot = robot or load_robot(self.robot)
        return load_player(controller, robot, duration=self.duration, pushes=None, noise=self.noise)
