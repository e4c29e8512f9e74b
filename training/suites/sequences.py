"""Several pushes in one trial: pushes that go on, and pushes into a step."""

from dataclasses import dataclass, field, replace
from typing import Literal

from poise.envs.pushes.push import Push
from poise.envs.pushes.sampler import PushSampler, Range, push_bodies
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.trial import Trial

from .base import MOST_TRIALS, Suite, generator, start_seed


@dataclass(frozen=True)
class SequenceSuite(Suite):
    """Random pushes one after the other, `pushes.interval` apart, for `until` seconds.

    `pushes.count` of them at most. The impulse of all but the first is multiplied by a number
    drawn from `later`. Without `bodies` the robot's first push body is pushed; a magnitude in
    controller_fraction is one of `--limits`, which may be a controller's own. `limit_fraction` is
    left out: no single push decides a trial.
    """

    kind: Literal["sequence"] = "sequence"
    duration: float = field(default=64.0, metadata={"above": 1.0})
    trials: int = field(default=50, metadata={"min": 1, "max": MOST_TRIALS})
    until: float = field(default=60.0, metadata={"above": 0.0})  # [s] no push begins later
    later: Range = field(default=(1.0, 1.0), metadata={"min": 0.0})
    pushes: PushSampler = field(
        default_factory=lambda: PushSampler(
            magnitude=(0.35, 0.35), unit="specific_impulse", count=(60, 60), interval=(2.0, 5.0)
        )
    )

    def __post_init__(self) -> None:
        if self.pushes.count[0] < 2 or self.pushes.no_push or self.pushes.unit == "delta_v":
            raise ValueError("pushes: a trial has at least two, and they are forces")
        if self.pushes.limit_table is not None:
            raise ValueError("pushes: limit_table belongs in a file of configs/limits")
        if self.later[0] > self.later[1]:
            raise ValueError(f"later: the range {self.later} must not decrease")

    def count(self, controllers: int) -> int:
        return self.trials

    def resized(self, trials: int) -> "SequenceSuite":
        return replace(self, trials=trials)

    def first(self, limits: PushLimits, seed: int) -> list[Trial]:
        bodies = self.pushes.bodies or push_bodies(limits.robot)[:1]
        sampler = replace(self.pushes, bodies=bodies)
        trials = []
        for number in range(self.trials):
            rng = generator(seed, number)
            drawn = sampler.sample(rng, limits.robot, limits.margin, limits.table)
            first, *rest = [push for push in drawn if isinstance(push, Push)]
            scaled = [replace(p, impulse=p.impulse * rng.uniform(*self.later)) for p in rest]
            later = tuple(push for push in scaled if push.start < self.until)
            trials.append(Trial(number, start_seed(seed, number), first, later=later))
        return trials
