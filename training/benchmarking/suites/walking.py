"""Parts for controllers that walk: commands, terrains, pushes and kicks.

A trial depends on the seed and its number alone, as in all parts. Pushes and kicks begin at a time
that goes through the phases of the gait evenly from trial to trial (the golden ratio's fractions),
whatever their size and direction.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import TimedCommand, parse_commands
from poise.configs.errors import ConfigError
from poise.envs.physics.pushes.push import Kick
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.terrain import Terrain, seeded
from poise.training.benchmarking.trials.trial import Trial

from .directions import Envelope
from .draw import MOST_TRIALS, Draw, Recovered, SuitePart, generator, repeated
from .random import PushSequence

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def from_start(command: GaitCommand) -> TimedCommand:
    """Return the command from the reset on."""
    return TimedCommand(**{**asdict(command), "start": 0.0})


def command_text(command: GaitCommand) -> str:
    """Return the command in words, such as `ahead 0.5, turn 0.25`."""
    names = [each.name for each in fields(GaitCommand)]
    said = [f"{name} {getattr(command, name):g}" for name in names if getattr(command, name)]
    return ", ".join(said) or "stand"


def commanded(command: GaitCommand) -> dict[str, Any]:
    """Return the fields of a trial with this command from start to end."""
    return {"level": command_text(command), "commands": (from_start(command),)}


@dataclass(frozen=True)
class WalkTrials(SuitePart):
    """Every command, `trials` times, from differently disturbed starts and without a push."""

    commands: tuple[GaitCommand, ...] = (GaitCommand(0.5),)
    trials: int = field(default=20, metadata={"min": 1, "max": MOST_TRIALS})

    def __post_init__(self) -> None:
        if not self.commands:
            raise ValueError("commands: must not be empty")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        each = repeated(self.commands, self.trials, number)
        return [draw.trial(k, **commanded(command)) for k, command in each]


@dataclass(frozen=True)
class GaitTrials(WalkTrials):
    """The same for commands with step parameters, which the steps are compared with."""

    commands: tuple[GaitCommand, ...] = (GaitCommand(0.5, step_length=0.2),)


@dataclass(frozen=True)
class Velocity(SuitePart):
    """Courses of commands that change while it walks, `trials` times each."""

    courses: dict[str, tuple[TimedCommand, ...]] = field(
        default_factory=lambda: {"circle": (TimedCommand(0.5, turn=0.25),)}
    )
    trials: int = field(default=10, metadata={"min": 1, "max": MOST_TRIALS})

    def __post_init__(self) -> None:
        for name, commands in self.courses.items():
            try:
                parse_commands(commands, f"courses.{name}")
            except ConfigError as error:
                raise ValueError(str(error)) from None
        if not all(self.courses.values()) or not self.courses:
            raise ValueError("courses: needs one command or more in each")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        each = repeated(self.courses.items(), self.trials, number)
        return [draw.trial(k, level=name, commands=course) for k, (name, course) in each]


@dataclass(frozen=True)
class Walking:
    """The walk that is pushed, and when: `start` [s] after the reset, within `window` [1/ω]."""

    command: GaitCommand = field(default_factory=lambda: GaitCommand(0.5))
    start: float = field(default=5.0, metadata={"min": 0.0})
    window: float = field(default=12.0, metadata={"min": 0.0})  # some strides

    def begins(self, draw: Draw, number: int) -> float:
        """Return the start of the push of a trial [s]."""
        shift = np.random.default_rng(np.random.SeedSequence([draw.seed, 3])).uniform()
        return float(self.start + (shift + GOLDEN * number) % 1.0 * self.window / draw.robot.omega)

    def walking(self, draw: Draw, trials: Iterable[Trial]) -> list[Trial]:
        """Return the trials with this command, their only push at its time."""
        return [
            replace(
                trial, **commanded(self.command),
                pushes=tuple(replace(p, start=self.begins(draw, trial.number))
                             for p in trial.pushes),
            )
            for trial in trials
        ]  # fmt: skip


@dataclass(frozen=True)
class WalkPush(Walking, Envelope):
    """J50 of a walk in each of many directions, as in an `Envelope`, over all phases of the gait.

    Trials are judged by falls, see `Trial.judged_by_falls`.
    """

    def first(self, draw: Draw, number: int) -> list[Trial]:
        return self.walking(draw, super().first(draw, number))

    def second(
        self, draw: Draw, number: int, first: Sequence[Trial], recovered: Recovered
    ) -> dict[str, list[Trial]]:
        chosen = super().second(draw, number, first, recovered)
        return {name: self.walking(draw, own) for name, own in chosen.items()}


@dataclass(frozen=True)
class WalkKick(Walking, SuitePart):
    """Kicks of the root while it walks: by each of `sizes` in a random direction, and in each axis
    of the ground up to ± one of `speeds`."""

    speeds: tuple[float, ...] = field(default=(0.5, 1.0), metadata={"above": 0.0})  # [m/s]
    trials: int = field(default=400, metadata={"min": 1, "max": MOST_TRIALS})  # of each
    #: changes of speed [m/s]
    sizes: tuple[float, ...] = field(default=(), metadata={"above": 0.0, "omit": "default"})

    def __post_init__(self) -> None:
        if not self.speeds and not self.sizes:
            raise ValueError("speeds: must not be empty where there are no sizes")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        kinds = [*((size, True) for size in self.sizes), *((speed, False) for speed in self.speeds)]
        return [
            self._trial(draw, k, size, fixed)
            for k, (size, fixed) in repeated(kinds, self.trials, number)
        ]

    def _trial(self, draw: Draw, number: int, size: float, fixed: bool) -> Trial:
        rng = generator(draw.seed, number)
        if fixed:
            delta_v, way, level = size, float(rng.uniform(-180.0, 180.0)), f"{size:g} m/s"
        else:
            x, y = rng.uniform(-size, size, 2)
            delta_v, way = float(np.hypot(x, y)), float(np.degrees(np.arctan2(y, x)))
            level = f"± {size:g} m/s"
        kick = Kick(self.begins(draw, number), delta_v, way)
        commands = (from_start(self.command),)
        return draw.trial(number, level=level, commands=commands, kicks=(kick,))


@dataclass(frozen=True)
class WalkRepeated(PushSequence):
    """Random pushes one after the other while it walks, see `Sequence`."""

    command: GaitCommand = field(default_factory=lambda: GaitCommand(0.5))

    def first(self, draw: Draw, number: int) -> list[Trial]:
        return [replace(trial, **commanded(self.command)) for trial in super().first(draw, number)]


#: parts of a suite for controllers that walk
WALKING = ("walk", "gait", "velocity", "walk_push", "walk_kick", "walk_repeated", "terrains")


@dataclass(frozen=True)
class Terrains(SuitePart):
    """Every terrain, `trials` times, from differently disturbed starts at one command.

    Each trial has a terrain of its own where heights are drawn: their seed is the trial's number.
    """

    terrains: dict[str, Terrain] = field(default_factory=lambda: {"stairs up": Stairs()})
    command: GaitCommand = field(default_factory=lambda: GaitCommand(0.5))
    trials: int = field(default=20, metadata={"min": 1, "max": MOST_TRIALS})

    def __post_init__(self) -> None:
        if not self.terrains:
            raise ValueError("terrains: must not be empty")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        commands = (from_start(self.command),)
        return [
            draw.trial(k, level=name, terrain=seeded(terrain, k - number), commands=commands)
            for k, (name, terrain) in repeated(self.terrains.items(), self.trials, number)
        ]
