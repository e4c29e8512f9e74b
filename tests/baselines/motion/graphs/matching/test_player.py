"""Motions that follow a command: they do, without jumps, and of true pieces of clips."""

from itertools import pairwise

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh, packaged_clips, walking_clips
from poise.baselines.motion.clips.rotations import angle_between
from poise.baselines.motion.graphs.joining.states import minus
from poise.baselines.motion.graphs.matching.database import MatchingDatabase
from poise.baselines.motion.graphs.matching.features import steady_heading
from poise.baselines.motion.graphs.matching.player import PlayerCommand, find_pieces, match_motion
from poise.configs.errors import ConfigError
from tests.support.motion_files import matching_clips


@pytest.fixture(scope="module")
def database() -> MatchingDatabase:
    return MatchingDatabase(matching_clips())


@pytest.mark.parametrize("turning", [0.0, 1e-4, 0.7, -2.0])
def test_the_future_of_a_command_is_its_path(turning: float) -> None:
    """Against integration in small steps."""
    command, dt = PlayerCommand(1.0, -0.4, turning), 1e-5
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
    """From standing: it walks, at the speed that is asked for, for as long as is asked."""
    motion = match_motion(database, lambda t: PlayerCommand(forward=0.4), 6.0)
    assert motion.clip.duration == pytest.approx(6.0)
    names = {database.clips[piece.clip].name for piece in motion.pieces[2:]}
    assert names == {"humanoid_walk"}
    gone = motion.clip.root[-1, :2] - motion.clip.root[60, :2]
    assert np.linalg.norm(gone) / 4.0 == pytest.approx(0.4, rel=0.15)


def test_a_command_to_stand_stays(database: MatchingDatabase) -> None:
    motion = match_motion(database, lambda t: PlayerCommand(), 5.0, start=(7, 10))
    gone = np.linalg.norm(motion.clip.root[-1, :2] - motion.clip.root[90, :2])
    assert gone < 0.3


@pytest.fixture(scope="module")
def walks() -> MatchingDatabase:
    """The packaged clips and the walk, as `poise motion match` has them."""
    names = [*packaged_clips(), *walking_clips()]
    return MatchingDatabase([read_bvh(find_bvh(name)).clip for name in names])


@pytest.mark.parametrize("speed", [0.3, 0.5, 0.8, 1.2])
def test_commands_within_the_clips_are_followed(walks: MatchingDatabase, speed: float) -> None:
    """From standing to 0.85 and more of what is commanded, straight ahead."""
    motion = match_motion(
        walks, lambda t: PlayerCommand(speed if t >= 1.0 else 0.0), 10.0, start=(5, 0)
    )
    first = round(2.0 / motion.clip.dt)
    gone = motion.clip.root[-1, :2] - motion.clip.root[first, :2]
    reached = np.linalg.norm(gone) / (8.0 * speed)
    assert 0.85 <= reached <= 1.15
    assert abs(np.arctan2(gone[1], gone[0])) < 0.35  # hips that sway do not turn the way


@pytest.mark.parametrize("turning", [0.4, -0.4])
def test_curves_are_followed(walks: MatchingDatabase, turning: float) -> None:
    command = PlayerCommand(0.7, turning=turning)
    motion = match_motion(
        walks, lambda t: command if t >= 1.0 else PlayerCommand(), 10.0, start=(5, 0)
    )
    heading = steady_heading(motion.clip)
    first = round(2.0 / motion.clip.dt)
    assert (heading[-1] - heading[first]) / 8.0 == pytest.approx(turning, rel=0.2)


def changes_of(clip: Clip) -> np.ndarray:
    """(F − 2,) by how much the step between frames changes, of the joint where it does most."""
    steps = minus(clip.root[1:], clip.rotations[1:], clip.root[:-1], clip.rotations[:-1])
    return np.asarray(np.abs(np.diff(steps, axis=0)[:, 3:]).max(axis=1))


@pytest.mark.parametrize("start", [(0, 75), (1, 40), (4, 50), (8, 50)])
def test_joins_leave_no_jump(start: tuple[int, int], database: MatchingDatabase) -> None:
    """From a kick, a punch, a deep squat and a wave: postures and rates change nowhere by more
    than within the clips, and where a hard cut would jump by more, by a quarter of that."""
    motion = match_motion(database, lambda t: PlayerCommand(forward=0.4 if t < 2.0 else 0.0), 4.0,
                          start=start)  # fmt: skip
    changes, at, ratios = changes_of(motion.clip), 0, []
    own = max(changes_of(clip).max() for clip in database.clips)
    for before, after in pairwise(motion.pieces):
        at += before.last - before.first
        old, new = database.clips[before.clip], database.clips[after.clip]
        jump = angle_between(old.rotations[before.last], new.rotations[after.first])[1:].max()
        if jump > own:
            ratios.append(changes[at - 2 : at + 1].max() / jump)
    assert ratios and max(ratios) < 0.25
    assert changes.max() < own


def test_pieces_are_what_is_played(database: MatchingDatabase) -> None:
    """Their frames add up; each begins at the nearest frame to its query; no clip is overrun."""
    pieces = find_pieces(database, lambda t: PlayerCommand(forward=0.4), 5.0)
    assert sum(piece.last - piece.first for piece in pieces) == 150
    for before, after in pairwise(pieces):
        assert after.first < after.last <= len(database.clips[after.clip]) - 1
        query = database.query(before.clip, before.last, PlayerCommand(0.4).future(database.ahead))
        assert database.nearest(query) == (after.clip, after.first, pytest.approx(after.distance))


def test_a_piece_goes_on_while_nothing_is_nearer(database: MatchingDatabase) -> None:
    """Without a say of the future every frame is its own nearest, until its clip ends."""
    names = (f"{name}@{time:g}" for time in database.ahead for name in ("place", "direction"))
    deaf = MatchingDatabase(database.clips, weights=dict.fromkeys(names, 0.0))
    pieces = find_pieces(deaf, lambda t: PlayerCommand(forward=0.4), 8.0, start=(7, 3))
    assert pieces[0][:3] == (7, 3, len(database.clips[7]) - 1) and len(pieces) >= 2


@pytest.mark.parametrize(
    ("duration", "start"), [(0.0, (0, 0)), (1.0, (99, 0)), (1.0, (0, 159)), (1.0, (-1, 0))]
)
def test_wrong_starts_are_errors(database: MatchingDatabase, duration, start) -> None:
    with pytest.raises(ConfigError, match="start"):
        match_motion(database, lambda t: PlayerCommand(), duration, start=start)
