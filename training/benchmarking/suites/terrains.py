"""The part of suites for controllers that walk over a terrain."""

from __future__ import annotations

from dataclasses import dataclass, field

from poise.baselines.walking.planner.command import GaitCommand
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.terrain import Terrain, seeded
from poise.training.benchmarking.trials.trial import Trial

from .draw import MOST_TRIALS, Draw, Part
from .walking import from_start


@dataclass(frozen=True)
class Terrains(Part):
    """Every terrain, `trials` times, from differently disturbed starts at one command.

    Each trial has a terrain of its own where heights are drawn: their seed is the trial's number.
    """

    terrains: dict[str, Terrain] = field(default_factory=lambda: {"stairs up": Stairs()})
    command: GaitCommand = field(default_factory=lambda: GaitCommand(0.5))
    trials: int = field(default=20, metadata={"min": 1, "max": MOST_TRIALS})

    def __post_init__(self) -> None:
        if not self.terrains:
            raise ValueError("terrains: must not be empty")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        each = [pair for pair in self.terrains.items() for _ in range(self.trials)]
        return [
            draw.trial(number + k, (), part="terrains", level=name, terrain=seeded(terrain, k),
                       commands=(from_start(self.command),))
            for k, (name, terrain) in enumerate(each)
        ]  # fmt: skip
