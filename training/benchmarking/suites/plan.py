"""All trials of a suite for a robot, as far as they are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial

from .draw import Draw, Part
from .factors import standard_levels
from .suite import Suite

Finished = Mapping[tuple[str, int], Outcome]  # controller, number of the trial → outcome


class Plan:
    """Lists the trials of each controller; numbers leave room for the second stage of a part.

    Attributes:
        suite: whose trials they are.
        limits: what pushes are measured by.
        names: of the controllers.
        motions: name → duration [s] of the motions that are performed.
        first: trials of the first stage, which all controllers play.
        standard: factor → level of the standard case, as text; empty without factors.
        count: trials of all stages and controllers.
    """

    def __init__(
        self,
        suite: Suite,
        limits: PushLimits,
        seed: int,
        names: Sequence[str],
        motions: Mapping[str, float] | None = None,
    ):
        self.suite, self.limits, self.names = suite, limits, tuple(names)
        self._draw = Draw(suite, limits, seed, motions)
        self._parts: list[tuple[Part, list[Trial], int]] = []  # with the second stage's number
        self.standard = standard_levels(self._draw) if suite.factors else {}
        number = 0
        for part in suite.parts.values():
            first = self._real(part.first(self._draw, number))
            second = number + len(first)
            self._parts.append((part, first, second))
            number = second + part.second_count(len(self.names))
        self.first = [trial for _, first, _ in self._parts for trial in first]
        self.count = number * len(self.names)

    def _real(self, trials: list[Trial]) -> list[Trial]:
        """The trials at the suite's level of realism, where they have none of their own."""
        level = self.suite.realism
        if level == IDEAL:
            return trials
        return [
            replace(trial, conditions=replace(trial.conditions, realism=level))
            if trial.conditions.realism is None else trial
            for trial in trials
        ]  # fmt: skip

    def second(self, finished: Finished) -> dict[str, list[Trial]]:
        """controller → its trials of the second stage; `finished` must hold all of the first."""
        chosen: dict[str, list[Trial]] = {name: [] for name in self.names}
        for part, first, number in self._parts:
            recovered = {
                name: [finished[name, trial.number].recovered for trial in first]
                for name in self.names
            }
            for name, trials in part.second(self._draw, number, first, recovered).items():
                chosen[name] += self._real(trials)
        return chosen

    def trials(self, finished: Finished) -> dict[str, list[Trial]]:
        """controller → all its trials, by number."""
        second = self.second(finished)
        return {name: sorted([*self.first, *second[name]], key=lambda trial: trial.number)
                for name in self.names}  # fmt: skip
