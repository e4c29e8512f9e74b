"""Motions that follow a command: they do, without jumps, and of true pieces of clips."""

from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.rotations import angle_between
from poise.baselines.motion.graphs.joining.states import minus
from poise.baselines.motion.graphs.matching.database import MatchingDatabase
from poise.baselines.motion.graphs.matching.player import Command, find_pieces, match_motion
from poise.configs.errors import ConfigError
from tests.support.captured import CMU, captured

pytestmark = captured


@pytest.fixture(scope="module")
def database() -> MatchingDatabase:
    names = CMU
    return MatchingDatabase([read_bvh(find_bvh(name)).clip for name in names])


@pytest.mark.parametrize("turning", [0.0, 1e-4, 0.7, -2.0])
def test_the_future_of_a_command_is_its_path(turning: float) -> None:
    """Against integration in small steps."""
    command, dt = Command(1.0, -0.4, turning), 1e-5
    heading, place = 0.0, np.zeros(2)
    for _ in range(round(0.5 / dt)):
        middle = heading + 0.5 * dt * turning
        c, s = np.cos(middle), np.sin(middle)
        place += dt * np.array([c * 1.0 + s * 0.4, s * 1.0 - c * 0.4])
        heading += dt * turning
    assert command.future((0.5,)) == pytest.approx(
        [*place, np.cos(heading), np.sin(heading)], abs=1e-6
    )


def test_a_command_to_walk_is_followed(database: MatchingDatabase) -> None:
    """From a punch: it walks, at the speed that is asked for, for as long as is asked."""
    motion = match_motion(database, lambda t: Command(forward=1.2), 6.0)
    assert motion.clip.duration == pytest.approx(6.0)
    names = {database.clips[piece.clip].name for piece in motion.pieces[2:]}
    assert names == {"cmu02_walk"}
    gone = motion.clip.root[-1, :2] - motion.clip.root[60, :2]
    assert np.linalg.norm(gone) / 4.0 == pytest.approx(1.2, rel=0.15)


def test_a_command_to_stand_stays(database: MatchingDatabase) -> None:
    motion = match_motion(database, lambda t: Command(), 5.0, start=(5, 10))
    gone = np.linalg.norm(motion.clip.root[-1, :2] - motion.clip.root[90, :2])
    assert gone < 0.3


def test_joins_leave_no_jump(database: MatchingDatabase) -> None:
    """Postures and rates: next to a cut the steps are those of the clips, which differ by less
    than a hard cut's by far."""
    motion = match_motion(database, lambda t: Command(forward=1.2 if t < 2.0 else 0.0), 4.0)
    clip, at, ratios = motion.clip, 0, []
    steps = minus(clip.root[1:], clip.rotations[1:], clip.root[:-1], clip.rotations[:-1])
    changes = np.abs(np.diff(steps, axis=0)[:, 3:]).max(axis=1)
    for before, after in pairwise(motion.pieces):
        at += before.last - before.first
        old, new = database.clips[before.clip], database.clips[after.clip]
        jump = angle_between(old.rotations[before.last], new.rotations[after.first])[1:].max()
        ratios.append(changes[at - 2 : at + 1].max() / jump)
    assert len(ratios) >= 4 and np.median(ratios) < 0.5
    assert changes.max() < 0.25


def test_pieces_are_what_is_played(database: MatchingDatabase) -> None:
    """Their frames add up; each begins at the nearest frame to its query; no clip is overrun."""
    pieces = find_pieces(database, lambda t: Command(forward=1.0), 5.0)
    assert sum(piece.last - piece.first for piece in pieces) == 150
    for before, after in pairwise(pieces):
        assert after.first < after.last <= len(database.clips[after.clip]) - 1
        query = database.query(before.clip, before.last, Command(1.0).future(database.ahead))
        assert database.nearest(query) == (after.clip, after.first, pytest.approx(after.distance))


def test_a_piece_goes_on_while_nothing_is_nearer(database: MatchingDatabase) -> None:
    """Without a say of the future every frame is its own nearest, until its clip ends."""
    names = (f"{name}@{time:g}" for time in database.ahead for name in ("place", "direction"))
    deaf = MatchingDatabase(database.clips, weights=dict.fromkeys(names, 0.0))
    pieces = find_pieces(deaf, lambda t: Command(forward=1.1), 8.0, start=(5, 3))
    assert pieces[0][:3] == (5, 3, len(database.clips[5]) - 1) and len(pieces) >= 2


@pytest.mark.parametrize(
    ("duration", "start"), [(0.0, (0, 0)), (1.0, (99, 0)), (1.0, (0, 159)), (1.0, (-1, 0))]
)
def test_wrong_starts_are_errors(database: MatchingDatabase, duration, start) -> None:
    with pytest.raises(ConfigError, match="start"):
        match_motion(database, lambda t: Command(), duration, start=start)
