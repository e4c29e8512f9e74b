"""Playing one trial with every controller, in whatever process.

The outcome depends on nothing but the trial, so that it is the same, bit for bit, whichever process
plays it and whatever it has played before.
"""

from __future__ import annotations

from dataclasses import dataclass

from poise.envs.robots.robot import load_robot

from .players import Player
from .stage import Stage
from .trial import Outcome, Trial, run_trial


@dataclass(frozen=True)
class EvaluationJob:
    """One trial for all controllers, by the names that `load_player` takes."""

    stage: Stage
    controllers: tuple[str, ...]
    trial: Trial


def play(job: EvaluationJob) -> list[Outcome]:
    """The outcome of every controller; raises ConfigError when one cannot be loaded here."""
    return [run_trial(player, job.trial) for player in _loaded(job.stage, job.controllers)]


_players: dict[tuple[Stage, tuple[str, ...]], list[Player]] = {}  # of this process


def _loaded(stage: Stage, controllers: tuple[str, ...]) -> list[Player]:
    key = (stage, controllers)
    if key not in _players:
        robot = load_robot(stage.robot)
        _players[key] = [stage.load(name, robot) for name in controllers]
    return _players[key]
