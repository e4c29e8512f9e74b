"""Trials that begin on the ground: whether a controller gets up, and how long it takes."""

from dataclasses import dataclass, field

from poise.envs.balance.start import FALLEN_POSTURES
from poise.training.benchmarking.trials.trial import Trial

from .draw import MOST_TRIALS, Draw, SuitePart, start_seed


@dataclass(frozen=True)
class GetUpPart(SuitePart):
    """Postures on the ground (`fallen_posture`), one a trial; none is one of those of training."""

    trials: int = field(default=100, metadata={"min": 1, "max": MOST_TRIALS})

    def first(self, draw: Draw, number: int) -> list[Trial]:
        numbers = range(number, number + self.trials)
        return [draw.trial(k, start=FALLEN_POSTURES + start_seed(draw.seed, k)) for k in numbers]
