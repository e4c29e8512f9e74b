"""A clip that follows a command, made of pieces that are searched for as it goes."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.graphs.joining.joins import inertial
from poise.configs.errors import ConfigError

from .database import Match, MatchingDatabase

EVERY = 0.2  # [s] between searches
HALF_LIFE = 0.1  # [s] of what a piece differs from where the last one ended
NEAR = 0.2  # [s] a frame that is so near to the one that plays is no other one
GAIN = 0.1  # by which share another frame must be nearer than the one that plays


class PlayerCommand(NamedTuple):
    """The commanded velocity and turn, in the heading frame."""

    forward: float = 0.0  # [m/s]
    left: float = 0.0  # [m/s]
    turning: float = 0.0  # [rad/s], positive to the left

    def future(self, ahead: tuple[float, ...]) -> np.ndarray:
        """(4 k,) place and direction after each time, by a constant velocity in turning axes.

        ∫₀ᵗ R(ω s) v ds = [sin ωt, cos ωt − 1; 1 − cos ωt, sin ωt] v/ω.
        """
        columns = []
        for time in ahead:
            angle = self.turning * time
            along = time * np.sinc(angle / np.pi)
            across = time * np.sinc(0.5 * angle / np.pi) * np.sin(0.5 * angle)
            columns += [along * self.forward - across * self.left,
                        across * self.forward + along * self.left,
                        np.cos(angle), np.sin(angle)]  # fmt: skip
        return np.array(columns)


class Piece(NamedTuple):
    """A piece of a clip: its first and last frame, and its distance from the query."""

    clip: int
    first: int
    last: int
    distance: float


class Matched(NamedTuple):
    """The motion that was made, and of which pieces."""

    clip: Clip
    pieces: tuple[Piece, ...]


def match_motion(
    database: MatchingDatabase,
    command: Callable[[float], PlayerCommand],
    duration: float,
    *,
    start: tuple[int, int] = (0, 0),
) -> Matched:
    """A motion that does what a command of the time [s] asks for, from frame `start` on.

    Every 0.2 s, and where a clip ends, the frame is searched that is nearest to the posture that
    plays with the future that is asked for. Where it is nearer than the frame that plays by 10 %,
    and another one by more than 0.2 s, it goes on from there, joined by `inertial`: C¹. Headings
    agree where pieces are joined, those without the hips' sway (`features.steady_heading`).

    Args:
        database: frames of the clips.
        command: asked at every search.
        duration: [s]; at least 2 frames.
        start: number of a clip, and of a frame in it that is not its last.

    Raises:
        ConfigError: a duration that is too short, or no such frame.
    """
    pieces = find_pieces(database, command, duration, start)
    dt = database.clips[0].dt
    parts = [database.clips[piece.clip].cut(piece.first * dt, piece.last * dt) for piece in pieces]
    whole, turn = parts[0], 0.0
    for (before, after), part in zip(pairwise(pieces), parts[1:], strict=True):
        turn += float(database.headings[before.clip][before.last]
                      - database.headings[after.clip][after.first])  # fmt: skip
        whole = inertial(whole, part.turned(turn), HALF_LIFE, faced=False)
    return Matched(whole, tuple(pieces))


def find_pieces(
    database: MatchingDatabase,
    command: Callable[[float], PlayerCommand],
    duration: float,
    start: tuple[int, int] = (0, 0),
) -> list[Piece]:
    """Return the pieces of `match_motion`; the last frame of one is the first of the next."""
    dt = database.clips[0].dt
    count, every = round(duration / dt), max(round(EVERY / dt), 2)
    clip, frame = start
    known = 0 <= clip < len(database.clips) and 0 <= frame < len(database.clips[clip]) - 1
    if not known or count < 1:
        raise ConfigError(f"must be a frame that another one follows and a time of {dt:.3g} s or "
                          f"more, not {start} and {duration:g} s", field="start")  # fmt: skip
    pieces, first, distance, done = [], frame, 0.0, 0
    while done < count:
        frames = min(every, len(database.clips[clip]) - 1 - frame, count - done)
        frame, done = frame + frames, done + frames
        if done == count:
            break
        query = database.query(clip, frame, command(done * dt).future(database.ahead))
        found = _better(database, query, clip, frame)
        if found is not None:
            pieces.append(Piece(clip, first, frame, distance))
            clip, frame, distance = found
            first = frame
    return [*pieces, Piece(clip, first, frame, distance)]


def _better(database: MatchingDatabase, query: np.ndarray, clip: int, frame: int) -> Match | None:
    """Where to go on, if not with the next frame."""
    found, dt = database.nearest(query), database.clips[0].dt
    ends = frame >= len(database.clips[clip]) - 1
    same = found.clip == clip and abs(found.frame - frame) * dt <= NEAR
    own = float(np.linalg.norm(database.values[database.starts[clip] + frame] - query))
    if ends or (not same and found.distance < (1.0 - GAIN) * own):
        return found
    return None
