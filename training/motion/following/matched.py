"""Motion matching from the command line: commands as text, the motion, and what it is made of."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh, packaged_clips, walking_clips
from poise.baselines.motion.graphs.matching.database import MatchingDatabase
from poise.baselines.motion.graphs.matching.features import seen_from, steady_heading
from poise.baselines.motion.graphs.matching.player import Matched, PlayerCommand, match_motion
from poise.configs.errors import ConfigError, shown
from poise.training.running.tables import text_table

FASTEST = 10.0  # [m/s, rad/s] that is asked for at most
LONGEST = 120.0  # [s]
FORM = "SECONDS:FORWARD,LEFT,TURN"
MOST_ROWS = 60


def parse_timed_commands(texts: Sequence[str]) -> "Commands":
    """Commands by the time from which on they hold, as ``0:1.2,0,0``; before the first one none.

    Forward and left are in m/s, turning to the left in rad/s; what is left out at the end is 0.

    Raises ConfigError for other texts, times that do not increase, or more than 10 m/s or rad/s.
    """
    times: list[float] = []
    commands = [PlayerCommand()]
    for text in texts:
        head, colon, tail = text.partition(":")
        try:
            time, values = float(head), [float(word) for word in tail.split(",")]
        except ValueError:
            time, values = np.nan, []
        if not colon or not 1 <= len(values) <= 3 or not 0.0 <= time < np.inf:
            raise ConfigError(f"must be {FORM}, not {shown(text)}", field="commands")
        if not all(abs(value) <= FASTEST for value in values):
            raise ConfigError(f"must be at most {FASTEST:g} m/s or rad/s, not {shown(text)}",
                              field="commands")  # fmt: skip
        if times and time <= times[-1]:
            raise ConfigError(f"must begin after the one before it, not {shown(text)}",
                              field="commands")  # fmt: skip
        times.append(time)
        commands.append(PlayerCommand(*values))
    return Commands(tuple(times), tuple(commands))


@dataclass(frozen=True)
class Commands:
    """Commands by time: `commands[k + 1]` from `times[k]` [s] on, before the first time none."""

    times: tuple[float, ...]
    commands: tuple[PlayerCommand, ...]

    def __call__(self, time: float) -> PlayerCommand:
        """Return the command at a time [s]."""
        return self.commands[bisect_right(self.times, time + 1e-9)]


def matched(
    files: Sequence[str], commands: Sequence[str], seconds: float, start: str = ""
) -> tuple[Matched, MatchingDatabase]:
    """Return the motion that follows the commands, made of clips of one skeleton.

    Args:
        files: .bvh files or names of packaged clips; none for the packaged ones, walks too.
        commands: see `parse_timed_commands`.
        seconds: how long.
        start: ``CLIP@SECONDS`` where it begins; empty for the first frame of the first clip.

    Raises ConfigError for what cannot be used; see `MatchingDatabase` and `read_bvh`.
    """
    asked = parse_timed_commands(commands)
    if not 0.1 <= seconds <= LONGEST:
        raise ConfigError(f"must be from 0.1 to {LONGEST:g}, not {seconds:g}", field="seconds")
    names = list(files) or [*packaged_clips(), *walking_clips()]
    database = MatchingDatabase([read_bvh(find_bvh(name)).clip for name in names])
    begin = _place(database, [Path(name).stem for name in names], start) if start else (0, 0)
    return match_motion(database, asked, seconds, start=begin), database


SETTLING = 1.0  # [s] after a command from which on it is compared with what is done
BEYOND = 0.15  # of a command that no clip reaches: more is said
LEAST = 0.1  # [m/s, rad/s] that always may be missed


def reached(clip: Clip, commands: Commands) -> Iterator[tuple[float, PlayerCommand, PlayerCommand]]:
    """For each command that holds for long enough: when, it, and the mean of what is done from 1 s
    after it: the way along where the body faces at the time, and the turn, over the time."""
    heading = steady_heading(clip)
    steps = np.diff(clip.root[:, :2], axis=0)
    along = seen_from(heading[:-1], np.column_stack([steps, np.zeros(len(steps))]))
    ends = [*commands.times[1:], clip.duration]
    for start, end, command in zip(commands.times, ends, commands.commands[1:], strict=True):
        first = round((start + SETTLING) / clip.dt)
        last = min(round(end / clip.dt), len(clip) - 1)
        if last - first >= round(SETTLING / clip.dt):
            time = (last - first) * clip.dt
            way, turned = along[first:last].sum(axis=0), heading[last] - heading[first]
            yield (
                start,
                command,
                PlayerCommand(*map(float, (way[0] / time, way[1] / time, turned / time))),
            )


def beyond(command: PlayerCommand, database: MatchingDatabase) -> PlayerCommand | None:
    """What the clips have that is nearest to a command which none of them reaches, else None."""
    time = database.ahead[-1]
    nearest = PlayerCommand(
        *(value / time for value in database.nearest_way(command.future((time,))))
    )
    gap = float(np.linalg.norm(np.subtract(nearest, command)))
    return nearest if gap > max(LEAST, BEYOND * float(np.linalg.norm(command))) else None


def print_matched(
    made: Matched, database: MatchingDatabase, commands: Commands, console: Console
) -> None:
    """Print which parts of which clips are used, the speed, and how well each command is met."""
    dt = database.clips[0].dt
    rows = (
        (database.clips[piece.clip].name, f"{piece.first * dt:.2f} s", f"{piece.last * dt:.2f} s",
         f"{piece.distance:.2f}")
        for piece in made.pieces[:MOST_ROWS]
    )  # fmt: skip
    title = f"{len(made.pieces)} pieces of {made.clip.duration:.1f} s"
    console.print(text_table(title, ("clip", "from", "to", "away"), (), rows))
    if len(made.pieces) > MOST_ROWS:
        console.print(f"and {len(made.pieces) - MOST_ROWS} pieces more")
    way = float(np.linalg.norm(np.diff(made.clip.root[:, :2], axis=0), axis=1).sum())
    console.print(f"{way:.1f} m, {way / made.clip.duration:.2f} m/s on average")
    for start, command, done in reached(made.clip, commands):
        console.print(f"from {start:g} s: {_said(command)} commanded, {_said(done)} reached")
    for command in dict.fromkeys(commands.commands[1:]):
        nearest = beyond(command, database)
        if nearest is not None:
            console.print(f"{_said(command)} is beyond the clips, which have {_said(nearest)}")


def _said(command: PlayerCommand) -> str:
    """Return a command in words, without what it leaves out."""
    others = ((command.left, "m/s left"), (command.turning, "rad/s"))
    said = [f"{value:.2f} {unit}" for value, unit in others if abs(value) >= 0.005]
    return ", ".join([f"{command.forward:.2f} m/s", *said])


def _place(database: MatchingDatabase, names: Sequence[str], text: str) -> tuple[int, int]:
    """Return the number of a clip and of a frame in it."""
    name, at, seconds = text.rpartition("@")
    known = {name: i for i, name in enumerate(names)}
    try:
        time = float(seconds)
    except ValueError:
        time = np.nan
    if not at or name not in known or not 0.0 <= time < np.inf:
        raise ConfigError(f"must be CLIP@SECONDS, not {shown(text)}", field="start",
                          choices=names)  # fmt: skip
    clip = database.clips[known[name]]
    frame = round(min(time, 1e6) / clip.dt)
    if frame > len(clip) - 2:
        raise ConfigError(f"must be before the end of {name!r} at {clip.duration:.2f} s, not "
                          f"{time:g} s", field="start")  # fmt: skip
    return known[name], frame
