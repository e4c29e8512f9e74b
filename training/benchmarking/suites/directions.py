"""Parts that treat all directions alike: the envelope of J50, the grid, and margins."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import ClassVar, Literal, Self

from poise.envs.physics.pushes.options import to_impulse
from poise.envs.physics.pushes.sampler import Range
from poise.training.benchmarking.statistics.fits import LogisticFit, fit_logistic
from poise.training.benchmarking.trials.trial import Trial

from .draw import MOST_TRIALS, Draw, Recovered, SuitePart, repeated


@dataclass(frozen=True)
class Envelope(SuitePart):
    """J50 in each of many directions, in two stages.

    The first spreads `first_trials` impulses over the whole range, one in each of as many equal
    parts. Its fit gives each controller's rough J50; the second stage spreads `trials` more over
    J50 · (1 ± spread). By default each controller has its own second stage, so its trials do not
    depend on the other controllers. With `paired` all controllers share all second stages, so they
    can be compared in pairs.

    If J50 in a direction is only a lower bound after the first stage, `reach` extends the second
    stage from (1 − spread) times that bound up to `reach`, with one trial at `reach`. A controller
    that recovers from all of them has then met the largest impulse.
    """

    directions: int = field(default=16, metadata={"min": 1, "max": 3600})  # evenly around
    fractions: Range = field(default=(0.2, 1.5), metadata={"above": 0.0})  # of the ankle limit
    impulses: Range | None = field(default=None, metadata={"above": 0.0})  # instead [N·s/kg]
    first_trials: int = field(default=8, metadata={"min": 2, "max": MOST_TRIALS})  # per direction
    trials: int = field(default=12, metadata={"min": 1, "max": MOST_TRIALS})  # the same, second
    spread: float = field(default=0.3, metadata={"above": 0.0, "max": 1.0})
    paired: bool = False
    #: largest impulse of the second stage [N·s/kg]; None: J50 · (1 + spread)
    reach: float | None = field(default=None, metadata={"above": 0.0, "omit": "default"})

    def __post_init__(self) -> None:
        for name, pair in (("fractions", self.fractions), ("impulses", self.impulses)):
            if pair is not None and pair[0] >= pair[1]:
                raise ValueError(f"{name}: {pair} must increase")
        if self.reach is not None and self.impulses and self.reach <= self.impulses[1]:
            raise ValueError(f"reach: must be above impulses, {self.impulses[1]:g}")

    def capped(self, trials: int) -> Self:
        most = replace(self, first_trials=max(min(self.first_trials, trials), 2))
        return most.resized(min(self.trials, trials))

    def first(self, draw: Draw, number: int) -> list[Trial]:
        return draw.spread(
            number, ((a, *self._range(draw, a), self.first_trials) for a in self.angles), stage=1
        )

    def second_count(self, controllers: int) -> int:
        return self.directions * self.trials * (controllers if self.paired else 1)

    def second(
        self, draw: Draw, number: int, first: Sequence[Trial], recovered: Recovered
    ) -> dict[str, list[Trial]]:
        def around(names: Iterable[str]) -> list[Trial]:
            rough = ((angle, self.rough(first, recovered[name], angle))
                     for angle in self.angles for name in names)  # fmt: skip
            ranges = (each for angle, fit in rough for each in self._around(draw, angle, fit))
            return draw.spread(number, ranges, stage=2)

        if self.paired:
            return dict.fromkeys(recovered, around(tuple(recovered)))
        return {name: around((name,)) for name in recovered}

    @property
    def angles(self) -> list[float]:
        """The directions [deg]."""
        return [360.0 * k / self.directions for k in range(self.directions)]

    def _range(self, draw: Draw, angle: float) -> Range:
        """Return the impulses of the first stage [N·s]."""
        if self.impulses is not None:
            low, high = (draw.robot.mass * j for j in self.impulses)
        else:
            limit = draw.limits.ankle(angle, draw.standard.push_duration)
            low, high = (fraction * limit for fraction in self.fractions)
        return low, high

    def _around(
        self, draw: Draw, angle: float, fit: LogisticFit
    ) -> Iterator[tuple[float, float, float, int]]:
        """Direction, least and largest impulse [N·s] and trials of the second stage."""
        low, high = (1.0 - self.spread) * fit.j50, (1.0 + self.spread) * fit.j50
        if self.reach is None or fit.bound != "lower":
            yield angle, low, high, self.trials
            return
        high = max(high, draw.robot.mass * self.reach)
        yield angle, low, high, self.trials - 1
        yield angle, high, high, 1

    def rough(self, first: Sequence[Trial], won: Sequence[bool], angle: float) -> LogisticFit:
        """Return the fit of J50 [N·s] to the first stage."""
        here = [(trial.pushes[0].impulse, each) for trial, each in zip(first, won, strict=True)
                if trial.pushes[0].direction == angle]  # fmt: skip
        return fit_logistic(*zip(*here, strict=True))


@dataclass(frozen=True)
class Grid(SuitePart):
    """Every magnitude in every direction, `repeats` times from differently disturbed starts."""

    directions: int = field(default=8, metadata={"min": 1, "max": 3600})
    magnitudes: tuple[float, ...] = field(
        default=(0.2, 0.3, 0.4, 0.5, 0.6), metadata={"above": 0.0}
    )
    unit: Literal["impulse", "force", "specific_impulse", "ankle_fraction"] = "specific_impulse"
    repeats: int = field(default=5, metadata={"min": 1, "max": MOST_TRIALS})
    SIZE: ClassVar[str] = "repeats"

    def __post_init__(self) -> None:
        if not self.magnitudes:
            raise ValueError("magnitudes: must not be empty")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        angles = [360.0 * k / self.directions for k in range(self.directions)]
        pushes = [
            draw.push(
                angle,
                to_impulse(
                    self.unit, magnitude, draw.robot, angle, draw.standard.push_duration, "square",
                    draw.limits.margin,
                ),
            )
            for angle, magnitude in product(angles, self.magnitudes)
        ]  # fmt: skip
        return [draw.trial(k, [push]) for k, push in repeated(pushes, self.repeats, number)]


@dataclass(frozen=True)
class Margin(SuitePart):
    """Equal pushes, repeated from differently disturbed starts: EUROBENCH's stability margin."""

    directions: tuple[float, ...] = field(
        default=(0.0, 90.0), metadata={"min": -360.0, "max": 360.0}
    )
    levels: tuple[float, ...] = field(default=(), metadata={"above": 0.0})  # of the ankle limit
    runs: int = field(default=10, metadata={"min": 1, "max": MOST_TRIALS})
    SIZE: ClassVar[str] = "runs"

    def first(self, draw: Draw, number: int) -> list[Trial]:
        duration = draw.standard.push_duration
        cases = [
            (draw.push(angle, level * draw.limits.ankle(angle, duration)), f"{level:g}")
            for angle, level in product(self.directions, self.levels)
        ]
        return [
            draw.trial(k, [push], level=level)
            for k, (push, level) in repeated(cases, self.runs, number)
        ]
