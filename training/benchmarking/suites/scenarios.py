"""The part of everyday scenarios by name, each with its own duration, pushes, walk and level.

The k-th trial of every scenario has the same seed: scenarios with equal
settings have the same pushes.
"""

from dataclasses import dataclass, field, replace

from poise.baselines.walking.planner.command import GaitCommand
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import PushSampler, Range
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.trials.trial import Conditions, Trial

from .draw import MOST_TRIALS, Draw, SuitePart, check_rising, start_seed
from .random import check_forces, one_after_the_other
from .walking import from_start

PART = "scenarios"
CALM = 4.0  # [s] at the end of a trial in which no push begins


@dataclass(frozen=True)
class Scenario:
    """Trials of one kind. Without `bodies` the robot's first push body is pushed."""

    duration: float = field(default=8.0, metadata={"above": CALM, "max": 1e6})  # [s]
    trials: int = field(default=12, metadata={"min": 1, "max": MOST_TRIALS})
    pushes: PushSampler | None = None
    later: Range = field(default=(1.0, 1.0), metadata={"min": 0.0})  # times all but the first push
    command: GaitCommand | None = None  # for controllers that walk
    realism: str = IDEAL  # a level or a file of one

    def __post_init__(self) -> None:
        if self.pushes is not None:
            check_forces(self.pushes)
        check_rising(self.later, "later")

    def drawn(self, draw: Draw, number: int) -> tuple[Push, ...]:
        """Return the pushes of a trial, by a number that all scenarios share."""
        if self.pushes is None:
            return ()
        return one_after_the_other(self.pushes, self.later, self.duration - CALM, draw, number)


@dataclass(frozen=True)
class Scenarios(SuitePart):
    """Scenarios by name, in this order."""

    each: dict[str, Scenario] = field(default_factory=lambda: {"quiet": Scenario()})

    def __post_init__(self) -> None:
        if not self.each:
            raise ValueError("each: must not be empty")

    @property
    def duration(self) -> float:
        """The longest of them [s]."""
        return max(scenario.duration for scenario in self.each.values())

    def resized(self, trials: int) -> "Scenarios":
        return replace(self, each={k: replace(s, trials=trials) for k, s in self.each.items()})

    def capped(self, trials: int) -> "Scenarios":
        fewer = {k: replace(s, trials=min(s.trials, trials)) for k, s in self.each.items()}
        return replace(self, each=fewer)

    def first(self, draw: Draw, number: int) -> list[Trial]:
        trials: list[Trial] = []
        for name, scenario in self.each.items():
            commands = () if scenario.command is None else (from_start(scenario.command),)
            level = None if scenario.realism == IDEAL else scenario.realism
            for k in range(scenario.trials):
                trials.append(
                    Trial(
                        number + len(trials), start_seed(draw.seed, number + k),
                        scenario.drawn(draw, number + k), Conditions(realism=level),
                        level=name, commands=commands, until=scenario.duration,
                    )
                )  # fmt: skip
        return trials
