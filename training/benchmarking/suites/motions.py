"""The part of performed motions, pushed by shares of the controller's J50."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Literal

from poise.baselines.balance.references.tempo import Tempo
from poise.envs.physics.pushes.sampler import LimitTable
from poise.training.benchmarking.trials.trial import Trial

from .directions import Envelope
from .draw import MOST_TRIALS, Draw, Recovered, SuitePart, generator, start_seed

STANDING = "standing"  # the motion, and the part, that J50 is first measured with
PART = "motions"
MARGIN = 0.1  # of a motion's duration, at its begin and at its end, in which no push begins
CLIPS = ("stand", "squat", "reach_down", "reach_up", "punch", "wave")


def label(name: str) -> str:
    """What a motion is called in trials: its name, or that of its file."""
    of_file = Path(name).suffix.lower() in (".npz", ".bvh", ".yaml", ".yml")
    return Path(name).stem if of_file else name


@dataclass(frozen=True)
class MotionTrials(SuitePart):
    """Every motion × share of J50 × direction, `trials` times, at a random time of the motion.

    A name is that of a packaged clip, which is retargeted to the robot first, of a packaged motion,
    or of a file. J50 is the controller's own: that of the file of limits if it is of this
    controller, else that of a first stage in which the robot stands. With `of: limits` it is that
    of the file for all controllers, so all have the same pushes and no first stage. Start,
    direction and time of a trial are the same for all controllers and shares.
    """

    names: tuple[str, ...] = tuple(f"humanoid_{clip}" for clip in CLIPS)
    directions: int = field(default=16, metadata={"min": 1, "max": 3600})  # evenly around
    shares: tuple[float, ...] = field(
        default=(0.0, 0.5, 0.8, 1.0, 1.2), metadata={"min": 0.0, "max": 10.0}
    )
    trials: int = field(default=1, metadata={"min": 1, "max": MOST_TRIALS})  # in every cell
    of: Literal["own", "limits"] = "own"
    tempo: Tempo = field(default_factory=Tempo, metadata={"omit": "default"})
    standing: Envelope = field(
        default_factory=lambda: Envelope(fractions=(0.3, 2.2), first_trials=16)
    )

    def __post_init__(self) -> None:
        for name, values in (("names", self.labels), ("shares", self.shares)):
            if not values:
                raise ValueError(f"{name}: must not be empty")
            if twice := [value for value, n in Counter(values).items() if n > 1]:
                raise ValueError(f"{name}: {twice[0]} comes twice")
        if STANDING in self.labels:
            raise ValueError(f"names: {STANDING} is always included")

    @property
    def labels(self) -> tuple[str, ...]:
        """What the motions are called in trials."""
        return tuple(label(name) for name in self.names)

    def first(self, draw: Draw, number: int) -> list[Trial]:
        if self.of == "limits":
            return self._cells(draw, number, draw.limits.j50())
        trials = self._standing.first(draw, number)
        return [replace(trial, part=STANDING, motion=STANDING) for trial in trials]

    def second_count(self, controllers: int) -> int:
        if self.of == "limits":
            return 0
        return len(self.names) * len(self.shares) * self.directions * self.trials

    def second(
        self, draw: Draw, number: int, first: Sequence[Trial], recovered: Recovered
    ) -> dict[str, list[Trial]]:
        if self.of == "limits":
            return {}
        return {
            name: self._cells(draw, number, self._own(draw, name, first, won), stage=2)
            for name, won in recovered.items()
        }

    @property
    def _standing(self) -> Envelope:
        return replace(self.standing, directions=self.directions)

    def _own(
        self, draw: Draw, name: str, first: Sequence[Trial], recovered: Sequence[bool]
    ) -> LimitTable:
        """J50 [N·s] of a controller that stands, by direction."""
        if draw.limits.controller == name:
            return draw.limits.j50()
        rough = [
            self._standing.rough(first, recovered, angle).j50 for angle in self._standing.angles
        ]
        return LimitTable(tuple(self._standing.angles), tuple(rough))

    def _cells(self, draw: Draw, number: int, j50: LimitTable, stage: int = 1) -> list[Trial]:
        """Return all trials of the motions, seeded by motion, direction and repeat only."""
        trials: list[Trial] = []
        for share, (motion, name) in product(self.shares, enumerate(self.labels)):
            for k in range(self.directions * self.trials):
                angle = 360.0 * (k % self.directions) / self.directions
                drawn = MOST_TRIALS + len(self.labels) * k + motion  # no other trial's number
                moment = generator(draw.seed, drawn).uniform(MARGIN, 1.0 - MARGIN)
                start = float(moment) * draw.motions[name]
                push = replace(draw.push(angle, share * j50(angle)), start=start)
                pushes = [push] if share else []
                trial = draw.trial(number + len(trials), pushes, stage=stage, motion=name,
                                   share=share)  # fmt: skip
                trials.append(replace(trial, seed=start_seed(draw.seed, drawn)))
        return trials
