"""What every suite is: a seeded choice of trials that all controllers play."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from poise.envs.balance.config import StartNoise
from poise.envs.pushes.push import Push
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.trial import Trial

MOST_TRIALS = 100_000  # all are drawn before the first is played
Recovered = Mapping[str, Sequence[bool]]  # controller → outcome of each trial


@dataclass(frozen=True)
class Suite:
    """What all suites have: how long a trial lasts and how far its start is disturbed."""

    kind: str = ""
    duration: float = field(default=6.0, metadata={"above": 1.0, "max": 1e6})  # of a trial [s]
    noise: StartNoise = field(default_factory=StartNoise)
    by_direction: ClassVar[bool] = False  # whether J50 is fitted for each direction

    def count(self, controllers: int) -> int:
        """Number of trials of all stages."""
        raise NotImplementedError

    def resized(self, trials: int) -> "Suite":
        """The suite with another number of trials, whatever that means for it."""
        raise NotImplementedError

    def first(self, limits: PushLimits, seed: int) -> list[Trial]:
        """The trials to begin with."""
        raise NotImplementedError

    def more(
        self, limits: PushLimits, seed: int, trials: Sequence[Trial], recovered: Recovered
    ) -> list[Trial]:
        """Trials chosen by the outcome of all earlier ones; none: the suite is over."""
        return []


def make_trial(seed: int, number: int, push: Push, limits: PushLimits, stage: int = 1) -> Trial:
    """A trial with its own seed and its push over the limit."""
    return Trial(number, start_seed(seed, number), push, limits.fraction(push), stage)


def start_seed(seed: int, number: int) -> int:
    """The seed of a trial's start, from those of the suite and the trial's number alone."""
    return int(np.random.SeedSequence([seed, number, 0]).generate_state(1)[0])


def generator(seed: int, number: int) -> np.random.Generator:
    """Draws the push of a trial, apart from what disturbs its start."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, 1]))
