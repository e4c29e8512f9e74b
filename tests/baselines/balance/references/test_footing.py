"""Motions whose feet leave the ground: curves, schedules, and what is none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.balance.references.footing import Footing, check_planted, make_footing
from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import (
    About,
    RobotClip,
    read_robot_clip,
    reference_from,
    write_robot_clip,
)
from tests.support.physics import robot_named
from tests.support.refused import invalid
from tests.support.robot_clips import swings


@pytest.fixture(scope="module")
def kick() -> Footing:
    footing = load_motion("kick", robot_named("humanoid")).footing
    assert footing is not None
    return footing


def rows(*runs: tuple[int, int, int]) -> np.ndarray:
    """Planted soles of so many frames each."""
    return np.concatenate([np.tile([left, right], (n, 1)) for left, right, n in runs]) > 0


def test_a_sole_rests_while_it_is_planted_and_swings_between(kick: Footing) -> None:
    ((foot, lift, land),) = swings(kick)
    assert (foot, lift, land) == (1, pytest.approx(1.5), pytest.approx(3.3))
    start = kick.sample(0.0).places
    for time in np.arange(0.0, 5.0, 0.07):
        sample = kick.sample(time)
        moving = lift < time < land
        assert sample.planted.tolist() == [True, not moving]
        assert sample.places[0, 1:] == pytest.approx(np.zeros((2, 3)))  # the left one never moves
        if not moving:
            assert sample.places[:, 0] == pytest.approx(start[:, 0], abs=1e-6)  # 1e-7 of the IK
    assert kick.sample(2.5).places[1, 0, 0] == pytest.approx(0.315, abs=0.005)  # 0.4 h ahead


def test_a_swing_begins_and_ends_smoothly(kick: Footing) -> None:
    """Place, velocity and acceleration have no jump at lift-off, on the way, and at touchdown."""
    for time in (1.5, 2.0, 2.5, 3.3):
        before, after = kick.sample(time - 1e-7), kick.sample(time + 1e-7)
        for name in ("com", "root", "places", "turns"):
            assert getattr(before, name) == pytest.approx(getattr(after, name), abs=1e-4), name


def test_velocities_are_those_of_the_places(kick: Footing) -> None:
    step = 1e-5
    for time in (0.9, 1.8, 2.3, 3.1):
        ahead, now, back = (kick.sample(time + d) for d in (step, 0.0, -step))
        for name in ("com", "places", "turns"):
            a, b, c = (getattr(s, name) for s in (ahead, now, back))
            rate = (a[..., 0, :] - c[..., 0, :]) / (2 * step)
            assert rate == pytest.approx(b[..., 1, :], abs=1e-6), name


def test_a_faster_motion_has_its_contacts_earlier() -> None:
    motion = load_motion("kick", robot_named("humanoid"))
    fast = motion.at_speed(1.25)
    assert motion.footing is not None and fast.footing is not None
    ((foot, lift, land),) = swings(fast.footing)
    assert (foot, lift, land) == (1, pytest.approx(1.5 / 1.25), pytest.approx(3.3 / 1.25))
    own, other = motion.footing.sample(2.5), fast.footing.sample(2.0)
    for power in range(3):
        for name in ("com", "root", "places", "turns"):
            a, b = (getattr(sample, name)[..., power, :] for sample in (own, other))
            np.testing.assert_allclose(b, a * 1.25**power, atol=1e-9)


@pytest.mark.parametrize(
    ("planted", "values"),
    [
        (rows((1, 0, 5), (1, 1, 5)), ()),
        (rows((1, 1, 5), (1, 0, 2), (1, 1, 5)), ("less than 3",)),
        (rows((1, 1, 5), (1, 0, 5), (0, 1, 5), (1, 1, 5)), ("frame 10",)),
    ],
)
def test_a_schedule_that_cannot_be_performed_is_refused(
    planted: np.ndarray, values: tuple[str, ...]
) -> None:
    with invalid("contacts", *values, source="x"):
        check_planted(planted, "x")


def test_a_robot_in_the_air_falls_freely() -> None:
    robot, planted = robot_named("humanoid"), rows((1, 1, 8), (0, 0, 6), (1, 1, 8))
    qpos = np.tile(robot.standing_qpos, (len(planted), 1))
    with invalid("contacts", "0.18 s", source="x"):
        make_footing(robot, qpos, 0.02, planted > 0, "x")
    t = (np.arange(len(planted)) - 10.5) * 0.02
    qpos[:, 2] += np.where(planted.any(axis=1), 0.0, 0.5 * 9.81 * (0.0625**2 - t**2))
    assert make_footing(robot, qpos, 0.02, planted > 0, "x").planted[1].tolist() == [0, 0]


def test_a_planted_sole_that_moves_is_named() -> None:
    robot = robot_named("humanoid")
    qpos = np.tile(robot.standing_qpos, (30, 1))
    qpos[:, 0] += np.linspace(0.0, 0.1, 30)
    with invalid("contacts"):
        make_footing(robot, qpos, 0.05, np.ones((30, 2), dtype=bool), "x")


def test_a_file_keeps_the_planted_soles_and_one_without_is_as_ever(tmp_path: Path) -> None:
    robot = robot_named("humanoid")
    about = About(robot.name, robot.fingerprint, "still")
    clip = RobotClip(about, 0.05, np.tile(robot.standing_qpos, (20, 1)))
    lifted = rows((1, 1, 8), (1, 0, 4), (1, 1, 8))
    write_robot_clip(clip, tmp_path / "both.npz")
    write_robot_clip(replace(clip, planted=lifted), tmp_path / "one.npz")
    assert read_robot_clip(tmp_path / "both.npz").planted is None
    again = read_robot_clip(tmp_path / "one.npz")
    assert np.array_equal(again.planted, lifted)
    footing = reference_from(again, robot, "one").footing
    assert footing is not None and swings(footing) == [(1, pytest.approx(0.35), pytest.approx(0.6))]


@pytest.mark.parametrize(
    ("planted", "reason"),
    [
        (np.ones((19, 2)), ("planted", "20")),
        (np.full((20, 2), 0.5), ("planted", "20")),
        (np.zeros((20, 2)), ("contacts",)),
    ],
)
def test_damaged_schedules_are_one_line(
    planted: np.ndarray, reason: tuple[str, ...], tmp_path: Path
) -> None:
    robot = robot_named("humanoid")
    about = About(robot.name, robot.fingerprint, "still")
    qpos, path = np.tile(robot.standing_qpos, (20, 1)), tmp_path / "bad.npz"
    write_robot_clip(RobotClip(about, 0.05, qpos, planted), path)
    with invalid(*reason):
        read_robot_clip(path)
