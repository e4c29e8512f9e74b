"""All trials of a suite for a robot, as far as they are known."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from poise.envs.sensing.drawn import check_limbs
from poise.envs.sensing.realism import IDEAL, load_realism
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial, counts_as_won

from .draw import Draw, SuitePart
from .factors import standard_levels
from .scenarios import PART as SCENARIOS
from .suite import Suite

LEVEL = "@"  # between the name of a part and the realism level at which it is repeated
Finished = Mapping[tuple[str, int], Outcome]  # controller, number of the trial → outcome


class _Planned(NamedTuple):
    """A part at a level."""

    name: str  # that the suite has for it
    part: SuitePart
    level: str | None  # None: the suite's own
    first: list[Trial]  # of the first stage
    second: int  # number that seeds the second stage
    shift: int  # from the seeding numbers of its trials to their own


class TrialPlan:
    """Lists the trials of each controller; numbers leave room for the second stage of a part.

    Attributes:
        suite: whose trials they are.
        limits: reference impulses of pushes.
        names: of the controllers.
        motions: name → duration [s] of the motions that are performed.
        standing: those of `names` that do not walk, and so skip scenarios with a command.
        first: trials of the first stage, the same for all controllers except these scenarios.
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
        standing: Collection[str] = (),
    ):
        self.suite, self.limits, self.names = suite, limits, tuple(names)
        self._standing = frozenset(standing)
        self._draw = Draw(suite, limits, seed, motions)
        self.standard = standard_levels(self._draw) if suite.factors else {}
        self._parts: list[_Planned] = []
        number = 0
        for level in (None, *suite.levels):
            drawn = 0  # all levels share random numbers
            for name, part in suite.parts.items():
                first = part.first(self._draw, drawn)
                second = drawn + len(first)
                following = second + part.second_count(len(self.names))
                if level is None or name != "factors":
                    shift = number - drawn
                    trials = self._at(name, level, shift, first)
                    self._parts.append(_Planned(name, part, level, trials, second, shift))
                    number += following - drawn
                drawn = following
        self.first = [trial for planned in self._parts for trial in planned.first]
        walked = sum(bool(trial.commands) for trial in self.first)
        self.count = number * len(self.names) - walked * len(self._standing)
        for real in dict.fromkeys(trial.conditions.realism for trial in self.first):
            check_limbs(load_realism(real), limits.robot)

    def plays(self, name: str, trial: Trial) -> bool:
        """Return whether the controller of this name runs a trial of the first stage."""
        return name not in self._standing or not trial.commands

    def _at(self, name: str, level: str | None, shift: int, trials: list[Trial]) -> list[Trial]:
        """Return the trials of a part at a level; None: their own level, else the suite's.

        A scenario's own level overrides the suite's.
        """
        real = self.suite.realism if level is None else level
        wait, found = self.suite.get_up_time, []
        for trial in trials:
            own = at = trial.conditions.realism
            if wait and trial.start is None:
                until = trial.until or self.suite.duration
                trial = replace(trial, until=until, get_up=wait)
            part = trial.part or name
            if real != IDEAL and (own is None or level is not None):
                at = real
            elif real != IDEAL and part == SCENARIOS:
                at = f"{real}+{own}"
            found.append(
                replace(
                    trial,
                    number=trial.number + shift,
                    part=part if level is None else at_level(part, level),
                    conditions=replace(trial.conditions, realism=at),
                )
            )
        return found

    def second(self, finished: Finished) -> dict[str, list[Trial]]:
        """controller → its trials of the second stage; `finished` must hold all of the first."""
        chosen: dict[str, list[Trial]] = {name: [] for name in self.names}
        for key, part, level, first, number, shift in self._parts:
            recovered = {
                name: [
                    counts_as_won(trial, finished[name, trial.number])
                    for trial in first
                    if self.plays(name, trial)
                ]
                for name in self.names
            }
            for name, trials in part.second(self._draw, number, first, recovered).items():
                chosen[name] += self._at(key, level, shift, trials)
        return chosen

    def trials(self, finished: Finished) -> dict[str, list[Trial]]:
        """controller → all its trials, by number."""
        second = self.second(finished)
        first = {name: [trial for trial in self.first if self.plays(name, trial)]
                 for name in self.names}  # fmt: skip
        return {
            name: sorted([*first[name], *second[name]], key=lambda trial: trial.number)
            for name in self.names
        }


def at_level(part: str, level: str) -> str:
    """Return the name of a part repeated at a realism level, such as envelope@field."""
    return f"{part}{LEVEL}{Path(level).stem}"
