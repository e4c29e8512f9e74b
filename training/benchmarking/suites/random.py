"""Parts of random pushes, of several in a trial, and of none.

A trial depends only on the seed and its number, so adding trials does not change the others.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import PushSampler, Range
from poise.training.benchmarking.trials.trial import Trial

from .draw import MOST_TRIALS, Draw, SuitePart, check_rising, generator, start_seed


@dataclass(frozen=True)
class Random(SuitePart):
    """Random pushes, one per trial.

    Without `bodies` those of the robot's description are pushed. A magnitude in
    controller_fraction is one in ankle_fraction for a robot whose baseline was not measured.
    """

    trials: int = field(default=1000, metadata={"min": 1, "max": MOST_TRIALS})
    pushes: PushSampler = field(
        default_factory=lambda: PushSampler(
            magnitude=(0.5, 1.6), unit="controller_fraction", duration=(0.05, 0.3)
        )
    )

    def __post_init__(self) -> None:
        if self.pushes.count != (1, 1):
            raise ValueError("pushes: a trial has exactly one push, and it is a force")
        check_forces(self.pushes)

    def first(self, draw: Draw, number: int) -> list[Trial]:
        return [
            draw.trial(k, sampled(self.pushes, draw.bodies, draw, generator(draw.seed, k)))
            for k in range(number, number + self.trials)
        ]


@dataclass(frozen=True)
class PushSequence(SuitePart):
    """Random pushes one after the other, `pushes.interval` apart, for `until` seconds.

    `pushes.count` of them at most. The impulse of all but the first is multiplied by a number
    drawn from `later`. Without `bodies` the robot's first push body is pushed; a magnitude in
    controller_fraction is a fraction of `--limits`, which may be a controller's own, or of the
    ankle limit if the robot has no measured J50. `limit_fraction` is empty: no single push decides
    a trial.
    """

    trials: int = field(default=50, metadata={"min": 1, "max": MOST_TRIALS})
    until: float = field(default=60.0, metadata={"above": 0.0})  # [s] no push begins later
    later: Range = field(default=(1.0, 1.0), metadata={"min": 0.0})
    pushes: PushSampler = field(
        default_factory=lambda: PushSampler(
            magnitude=(0.35, 0.35), unit="specific_impulse", count=(60, 60), interval=(2.0, 5.0)
        )
    )

    def __post_init__(self) -> None:
        if self.pushes.count[0] < 2:
            raise ValueError("pushes: a trial has at least two, and they are forces")
        check_forces(self.pushes)
        check_rising(self.later, "later")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        trials = []
        for here in range(number, number + self.trials):
            pushes = one_after_the_other(self.pushes, self.later, self.until, draw, here)
            trials.append(Trial(here, start_seed(draw.seed, here), pushes))
        return trials


@dataclass(frozen=True)
class Quiet(SuitePart):
    """No push at all."""

    trials: int = field(default=20, metadata={"min": 1, "max": MOST_TRIALS})

    def first(self, draw: Draw, number: int) -> list[Trial]:
        return [draw.trial(k) for k in range(number, number + self.trials)]


def sampled(
    sampler: PushSampler, bodies: tuple[str, ...], draw: Draw, rng: np.random.Generator
) -> list[Push]:
    """Return the pushes of a trial, of `bodies` where the sampler names none.

    A fraction of J50 is one of the ankle limit if the robot has no measured J50.
    """
    limits = draw.limits
    sampler = replace(sampler, bodies=sampler.bodies or bodies)
    if sampler.unit == "controller_fraction" and limits.table is None:
        sampler = replace(sampler, unit="ankle_fraction")
    drawn = sampler.sample(rng, limits.robot, limits.margin, limits.table)
    return [push for push in drawn if isinstance(push, Push)]


def one_after_the_other(
    sampler: PushSampler, later: Range, until: float, draw: Draw, number: int
) -> tuple[Push, ...]:
    """Return the pushes of a trial that begin before `until` [s]; all but the first times a number
    from `later`. Without `bodies` the robot's first push body is pushed."""
    rng = generator(draw.seed, number)
    first, *rest = sampled(sampler, draw.bodies[:1], draw, rng)
    scaled = [replace(p, impulse=p.impulse * rng.uniform(*later)) for p in rest]
    return (first, *(push for push in scaled if push.start < until))


def check_forces(pushes: PushSampler) -> None:
    """Raise ValueError for pushes that are no forces, or not in every trial."""
    if pushes.no_push or pushes.unit == "delta_v":
        raise ValueError("pushes: they are forces, in every trial")
    if pushes.limit_table is not None:
        raise ValueError("pushes: limit_table is not of a suite: pass it with --limits FILE, whose "
                         "keys are robot, fingerprint, controller and table; poise evaluate with "
                         "--suite envelope and --write-limits FILE writes one")  # fmt: skip
