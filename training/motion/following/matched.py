"""Motion matching from the command line: commands as text, the motion, and what it is made of."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh, packaged_clips
from poise.baselines.motion.graphs.matching.database import MatchingDatabase
from poise.baselines.motion.graphs.matching.player import Command, Matched, match_motion
from poise.configs.errors import ConfigError, shown
from poise.training.running.tables import text_table

FASTEST = 10.0  # [m/s, rad/s] that is asked for at most
LONGEST = 120.0  # [s]
FORM = "SECONDS:FORWARD,LEFT,TURN"
MOST_ROWS = 60


def parse_commands(texts: Sequence[str]) -> Callable[[float], Command]:
    """Commands by the time from which on they hold, as ``0:1.2,0,0``; before the first one none.

    Forward and left are in m/s, turning to the left in rad/s; what is left out at the end is 0.

    Raises ConfigError for other texts, times that do not increase, or more than 10 m/s or rad/s.
    """
    times: list[float] = []
    commands = [Command()]
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
        commands.append(Command(*values))
    return lambda time: commands[bisect_right(times, time + 1e-9)]


def matched(
    files: Sequence[str], commands: Sequence[str], seconds: float, start: str = ""
) -> tuple[Matched, MatchingDatabase]:
    """The motion that does what is asked for, of clips of one skeleton.

    Args:
        files: .bvh files or names of packaged clips; none for the packaged ones.
        commands: see `parse_commands`.
        seconds: how long.
        start: ``CLIP@SECONDS`` where it begins; empty for the first frame of the first clip.

    Raises ConfigError for what cannot be used; see `MatchingDatabase` and `read_bvh`.
    """
    asked = parse_commands(commands)
    if not 0.1 <= seconds <= LONGEST:
        raise ConfigError(f"must be from 0.1 to {LONGEST:g}, not {seconds:g}", field="seconds")
    names = list(files) or packaged_clips()
    database = MatchingDatabase([read_bvh(find_bvh(name)).clip for name in names])
    begin = _place(database, [Path(name).stem for name in names], start) if start else (0, 0)
    return match_motion(database, asked, seconds, start=begin), database


def print_matched(made: Matched, database: MatchingDatabase, console: Console) -> None:
    """What is played of which clip, and how fast the whole goes."""
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


def _place(database: MatchingDatabase, names: Sequence[str], text: str) -> tuple[int, int]:
    """The number of a clip and of a frame in it."""
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
