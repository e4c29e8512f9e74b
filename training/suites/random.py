"""Suites of random pushes, and of none.

A trial depends on the seed and its number alone, so more of them leave the first ones as they
were.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

from poise.envs.pushes.push import Push
from poise.envs.pushes.sampler import PushSampler, push_bodies
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.trial import Trial

from .base import MOST_TRIALS, Suite, generator, make_trial, start_seed


@dataclass(frozen=True)
class RandomSuite(Suite):
    """Random pushes, one per trial.

    Without `bodies` those of the robot's description are pushed. A magnitude in
    controller_fraction is one in ankle_fraction for a robot whose baseline was not measured.
    """

    kind: Literal["random"] = "random"
    trials: int = field(default=1000, metadata={"min": 1, "max": MOST_TRIALS})
    pushes: PushSampler = field(
        default_factory=lambda: PushSampler(
            magnitude=(0.5, 1.6), unit="controller_fraction", duration=(0.05, 0.3)
        )
    )

    def __post_init__(self) -> None:
        if self.pushes.count != (1, 1) or self.pushes.no_push or self.pushes.unit == "delta_v":
            raise ValueError("pushes: a trial has exactly one push, and it is a force")
        if self.pushes.limit_table is not None:
            raise ValueError("pushes: limit_table belongs in a file of configs/limits")

    def count(self, controllers: int) -> int:
        return self.trials

    def resized(self, trials: int) -> "RandomSuite":
        return replace(self, trials=trials)

    def first(self, limits: PushLimits, seed: int) -> list[Trial]:
        bodies = self.pushes.bodies or push_bodies(limits.robot)
        sampler = replace(self.pushes, bodies=bodies)
        if sampler.unit == "controller_fraction" and limits.table is None:
            sampler = replace(sampler, unit="ankle_fraction")
        trials = []
        for number in range(self.trials):
            rng = generator(seed, number)
            (push,) = sampler.sample(rng, limits.robot, limits.margin, limits.table)
            assert isinstance(push, Push)
            trials.append(make_trial(seed, number, push, limits))
        return trials


@dataclass(frozen=True)
class QuietSuite(Suite):
    """No push at all, for a long time."""

    kind: Literal["quiet"] = "quiet"
    duration: float = field(default=60.0, metadata={"above": 1.0, "max": 1e6})
    trials: int = field(default=20, metadata={"min": 1, "max": MOST_TRIALS})

    def count(self, controllers: int) -> int:
        return self.trials

    def resized(self, trials: int) -> "QuietSuite":
        return replace(self, trials=trials)

    def first(self, limits: PushLimits, seed: int) -> list[Trial]:
        return [Trial(number, start_seed(seed, number)) for number in range(self.trials)]
