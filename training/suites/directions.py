"""Suites that ask the same of every direction: the envelope of J50, and the grid."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np

from poise.envs.pushes.options import check_body, to_impulse
from poise.envs.pushes.push import Push
from poise.envs.pushes.sampler import Range, push_bodies
from poise.training.statistics.fits import fit_logistic
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.trial import Trial

from .base import MOST_TRIALS, Recovered, Suite, generator, make_trial


@dataclass(frozen=True)
class EnvelopeSuite(Suite):
    """J50 in each of many directions, in two stages.

    The first spreads `first_trials` impulses over `impulses`, one in each of as many equal parts.
    Its fit gives each controller's rough J50; the second stage spreads `trials` more over
    J50 · (1 ± spread), for every controller. All controllers play all trials.
    """

    kind: Literal["envelope"] = "envelope"
    # evenly around the circle
    directions: int = field(default=16, metadata={"min": 1, "max": 3600})
    body: str | None = None  # the robot's first push body
    push_duration: float = field(default=0.1, metadata={"above": 0.0})  # square [s]
    start: float = field(default=0.5, metadata={"min": 0.0})  # [s]
    impulses: Range = field(default=(0.12, 0.9), metadata={"above": 0.0})  # [N·s/kg]
    first_trials: int = field(default=12, metadata={"min": 2, "max": MOST_TRIALS})  # per direction
    trials: int = field(
        default=24, metadata={"min": 1, "max": MOST_TRIALS}
    )  # per direction and controller
    spread: float = field(default=0.3, metadata={"above": 0.0, "max": 1.0})
    by_direction: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if self.impulses[0] >= self.impulses[1]:
            raise ValueError(f"impulses: {self.impulses} must increase")

    def count(self, controllers: int) -> int:
        return self.directions * (self.first_trials + controllers * self.trials)

    def resized(self, trials: int) -> "EnvelopeSuite":
        return replace(self, trials=trials)

    def first(self, limits: PushLimits, seed: int) -> list[Trial]:
        low, high = (limits.robot.mass * j for j in self.impulses)
        ranges = [(angle, low, high, self.first_trials) for angle in self._angles()]
        return self._spread(limits, seed, 0, ranges, stage=1)

    def more(
        self, limits: PushLimits, seed: int, trials: Sequence[Trial], recovered: Recovered
    ) -> list[Trial]:
        if trials[-1].stage == 2:
            return []
        direction = np.array([_push(t).direction for t in trials])
        impulse = np.array([_push(t).impulse for t in trials])
        ranges = []
        for angle in self._angles():
            here = direction == angle
            for outcome in recovered.values():
                rough = fit_logistic(impulse[here], np.asarray(outcome)[here]).j50
                low, high = (1.0 - self.spread) * rough, (1.0 + self.spread) * rough
                ranges.append((angle, low, high, self.trials))
        return self._spread(limits, seed, len(trials), ranges, stage=2)

    def _angles(self) -> list[float]:
        return [360.0 * k / self.directions for k in range(self.directions)]

    def _spread(
        self,
        limits: PushLimits,
        seed: int,
        number: int,
        ranges: Sequence[tuple[float, float, float, int]],
        stage: int,
    ) -> list[Trial]:
        """`count` trials per (direction, low, high, count), one in each of as many equal parts."""
        body = _body(self.body, limits)
        trials = []
        for angle, low, high, count in ranges:
            for part in range(count):
                share = (part + generator(seed, number).uniform()) / count
                impulse = low + share * (high - low)
                push = Push(body, self.start, self.push_duration, impulse, angle)
                trials.append(make_trial(seed, number, push, limits, stage))
                number += 1
        return trials


@dataclass(frozen=True)
class GridSuite(Suite):
    """Every magnitude in every direction, `repeats` times from differently disturbed starts."""

    kind: Literal["grid"] = "grid"
    directions: int = field(default=8, metadata={"min": 1, "max": 3600})
    magnitudes: tuple[float, ...] = field(
        default=(0.2, 0.3, 0.4, 0.5, 0.6), metadata={"above": 0.0}
    )
    unit: Literal["impulse", "force", "specific_impulse", "ankle_fraction"] = "specific_impulse"
    repeats: int = field(default=5, metadata={"min": 1, "max": MOST_TRIALS})
    body: str | None = None
    push_duration: float = field(default=0.1, metadata={"above": 0.0})
    start: float = field(default=0.5, metadata={"min": 0.0})
    by_direction: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not self.magnitudes:
            raise ValueError("magnitudes: must not be empty")

    def count(self, controllers: int) -> int:
        return self.directions * len(self.magnitudes) * self.repeats

    def resized(self, trials: int) -> "GridSuite":
        return replace(self, repeats=trials)

    def first(self, limits: PushLimits, seed: int) -> list[Trial]:
        body = _body(self.body, limits)
        trials: list[Trial] = []
        for k in range(self.directions):
            angle = 360.0 * k / self.directions
            for magnitude in self.magnitudes:
                impulse = to_impulse(
                    self.unit, magnitude, limits.robot, angle, self.push_duration, "square",
                    limits.margin,
                )  # fmt: skip
                push = Push(body, self.start, self.push_duration, impulse, angle)
                for _ in range(self.repeats):
                    trials.append(make_trial(seed, len(trials), push, limits))
        return trials


def _body(name: str | None, limits: PushLimits) -> str:
    if name is None:
        return push_bodies(limits.robot)[0]
    check_body(name, limits.robot, "suite")
    return name


def _push(trial: Trial) -> Push:
    assert trial.push is not None
    return trial.push
