"""Commands over time: read from what a caller wrote, drawn at random, followed by compiled code."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from itertools import pairwise, product
from typing import Annotated

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.schema import build, to_dict
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.clock import Clock
from poise.envs.physics.pushes.sampler import Range

from .planner.command import ENTRIES, GaitCommand

MOST_COMMANDS = 256  # of an episode
AXES = ("ahead", "left", "turn")  # which one number may fix
SOON = 1e-9  # [s] by which times may round


@dataclass(frozen=True)
class TimedCommand(GaitCommand):
    """A command that holds from `start` [s] after the reset until the next one."""

    start: float = field(default=0.0, metadata={"min": 0.0})


@dataclass(frozen=True)
class CommandSampler:
    """Commands that an environment draws; every range [lo, hi] is drawn from uniformly.

    The first one holds from the reset on; with an `interval` [s] another one is drawn after each,
    at most 256 in an episode. Equal ends are a fixed command.

    Attributes:
        ahead: Range of the commanded speed ahead [m/s].
        left: Range of the commanded speed to the left [m/s].
        turn: Range of the commanded turning rate to the left [rad/s].
        interval: Range of the time after which another command is drawn [s]; None: one holds
            throughout.
        stand: Fraction of the commands that are to stand.
        alone: Fraction of the others that are a speed ahead, to the left or a turn alone.
    """

    ahead: Range = (0.5, 0.5)
    left: Range = (0.0, 0.0)
    turn: Range = (0.0, 0.0)
    interval: Range | None = field(default=None, metadata={"above": 0.0})
    stand: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0, "omit": "default"})
    alone: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0, "omit": "default"})

    def __post_init__(self) -> None:
        for name in ("ahead", "left", "turn", "interval"):
            pair = getattr(self, name)
            if pair is not None and pair[0] > pair[1]:
                raise ValueError(f"{name}: the range [{pair[0]}, {pair[1]}] must not decrease")

    def sample(self, rng: np.random.Generator, duration: float) -> tuple[TimedCommand, ...]:
        """The commands of an episode of `duration` [s]; the same for the same generator state."""
        drawn, start = [self._draw(rng, 0.0)], 0.0
        while self.interval is not None and len(drawn) < MOST_COMMANDS:
            start += rng.uniform(*self.interval)
            if start >= duration:
                break
            drawn.append(self._draw(rng, start))
        return tuple(drawn)

    def extremes(self) -> list[GaitCommand]:
        """The commands at the ends of all ranges; a robot that can these can all that is drawn."""
        corners = product(set(self.ahead), set(self.left), set(self.turn))
        return [GaitCommand(*corner) for corner in sorted(corners)]

    def _draw(self, rng: np.random.Generator, start: float) -> TimedCommand:
        ahead, left, turn = (float(rng.uniform(*r)) for r in (self.ahead, self.left, self.turn))
        if self.stand > 0.0 and rng.random() < self.stand:
            return TimedCommand(0.0, 0.0, 0.0, start)
        if self.alone > 0.0 and rng.random() < self.alone:
            kept = rng.integers(len(AXES))
            ahead, left, turn = (x * (i == kept) for i, x in enumerate((ahead, left, turn)))
        return TimedCommand(ahead, left, turn, start)


def command_sampler(value: object) -> CommandSampler:
    """A sampler from itself, from a `GaitCommand`, or from a mapping of ranges or numbers.

    Raises ConfigError naming the field that is not valid, and what there is.
    """
    if isinstance(value, CommandSampler):
        return value
    if isinstance(value, GaitCommand):
        given = {each.name: getattr(value, each.name) for each in fields(GaitCommand)}
        drawn = {each.name for each in fields(CommandSampler)}  # the others are refused below
        value = {name: x for name, x in given.items() if x or name in drawn}
    if not isinstance(value, Mapping):
        raise ConfigError(
            f"must be a command or ranges of commands, not {shown(value)}",
            field="command",
            choices=[each.name for each in fields(CommandSampler)],
        )
    data = {str(key): to_dict(entry) for key, entry in value.items()}
    alone = (int, float)
    ranges = {
        key: [entry, entry] if isinstance(entry, alone) and key in AXES else entry
        for key, entry in data.items()
    }
    return build(CommandSampler, ranges, "command")


def parse_commands(value: object, source: str = "reset: command") -> tuple[TimedCommand, ...]:
    """Commands from one mapping, one `GaitCommand`, or a list of them in the order of `start`.

    A mapping has the keys of `GaitCommand`, and `start` [s after the reset], 0 where it is left
    out; [] is to stand.

    Raises ConfigError naming `source`, the field and the choices for an unknown key, a number that
    is not finite, and times that do not increase.
    """
    given = [value] if isinstance(value, (Mapping, GaitCommand)) else value
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ConfigError(f"must be a mapping or a list of them, not {shown(value)}", source=source)
    commands = tuple(_parse_one(each, source) for each in given)
    if any(a.start >= b.start for a, b in pairwise(commands)):
        raise ConfigError("must increase from command to command", source=source, field="start")
    if len(commands) > MOST_COMMANDS:
        raise ConfigError(f"at most {MOST_COMMANDS} commands", source=source)
    return commands


def _parse_one(item: object, source: str) -> TimedCommand:
    data = asdict(item) if isinstance(item, GaitCommand) else item
    if not isinstance(data, Mapping):
        raise ConfigError(f"must be a mapping, not {shown(item)}", source=source,
                          choices=TimedCommand.__dataclass_fields__)  # fmt: skip
    return build(TimedCommand, {str(k): to_dict(v) for k, v in data.items()}, source)


@dataclass(eq=False)
class Timetable(Block):
    """The commands of an episode as compiled code reads them."""

    start: Annotated[np.ndarray, MOST_COMMANDS]  # [s]; infinite behind the last one
    commands: Annotated[np.ndarray, MOST_COMMANDS, ENTRIES]  # see `GaitCommand.array`
    following: Mutable[int]  # the row that comes next

    def fill(self, commands: Sequence[TimedCommand]) -> None:
        """Take the commands of an episode that begins."""
        self.clear()
        for i, command in enumerate(commands):
            self.start[i], self.commands[i] = command.start, command.array()

    def clear(self) -> None:
        """Leave the command as it is."""
        self.start[:] = np.inf
        self.following = 0


def empty_timetable() -> Timetable:
    """A timetable without a command."""
    table = Timetable.allocate()
    table.clear()
    return table


@dataclass(frozen=True, eq=False)
class Follower(Block):
    """The block of `follow_timetable`."""

    timetable: Timetable
    clock: Clock
    timestep: float  # [s]
    command: np.ndarray  # (8,) of the controller's gait


@compiled
def follow_timetable(f: Follower):
    """Tell the controller the command that the time has come for."""
    table = f.timetable
    now, i = f.clock.steps * f.timestep + SOON, table.following
    while i < table.start.shape[0] and table.start[i] <= now:
        for a in range(f.command.shape[0]):
            f.command[a] = table.commands[i, a]
        i += 1
    table.following = i
