"""Suites by name: `configs/suites/*.yaml`, or a path to such a file.

A trial depends on the seed and its number alone, so more random or quiet trials leave the first
ones as they were.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from poise.envs.config import build, read_yaml, resolve
from poise.envs.errors import ConfigError, shown
from poise.envs.push_schedule import PushSampler, push_bodies
from poise.envs.pushes import Push

from .direction_suites import EnvelopeSuite, GridSuite
from .limits import PushLimits
from .sequence_suite import SequenceSuite
from .suite import MOST_TRIALS, Suite, generator, make_trial, start_seed
from .trials import Trial


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


KINDS: dict[str, type[Suite]] = {
    "random": RandomSuite,
    "envelope": EnvelopeSuite,
    "grid": GridSuite,
    "quiet": QuietSuite,
    "sequence": SequenceSuite,
}


def load_suite(name: str | Path) -> Suite:
    """A packaged suite (`configs/suites`) or a path to one.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("suites", name)
    return build_suite(read_yaml(path), str(path))


def build_suite(data: dict[str, Any], source: str) -> Suite:
    """A suite from the fields of its kind; raises ConfigError."""
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigError(f"no such kind of suite: {shown(kind)}", source=source, field="kind",
                          choices=KINDS)  # fmt: skip
    return build(KINDS[kind], data, source)
