"""Files of a robot's postures: the same again, and damaged ones are one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import (
    About,
    RobotClip,
    read_robot_clip,
    reference_from,
    write_robot_clip,
)
from poise.configs.errors import ConfigError, PoiseError
from tests.support.physics import robot_named
from tests.support.refused import invalid


@pytest.fixture
def standing() -> RobotClip:
    robot = robot_named("humanoid")
    about = About(robot.name, robot.fingerprint, "still", "test", "none")
    return RobotClip(about, 0.05, np.tile(robot.standing_qpos, (20, 1)))


def test_a_file_gives_the_same_again_and_the_same_bytes(
    standing: RobotClip, tmp_path: Path
) -> None:
    for name in ("a.npz", "b.npz"):
        write_robot_clip(standing, tmp_path / name)
    again = read_robot_clip(tmp_path / "a.npz")
    assert again.about == standing.about and again.dt == standing.dt
    assert np.array_equal(again.qpos, standing.qpos)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert np.array_equal(np.load(tmp_path / "a.npz")["qpos"], standing.qpos)


def test_a_name_of_a_file_is_a_motion(standing: RobotClip, tmp_path: Path) -> None:
    robot, path = robot_named("humanoid"), tmp_path / "still.npz"
    write_robot_clip(standing, path)
    sample = load_motion(path, robot).sample(0.4)
    still = load_motion("standing", robot).sample(0.4)
    for value, wanted in zip(sample, still, strict=True):
        assert value == pytest.approx(wanted, abs=1e-9)


def test_a_lifted_foot_and_a_joint_out_of_range_are_refused(standing: RobotClip) -> None:
    robot = robot_named("humanoid")
    knee = 7 + robot.joint_names.index("left_knee")
    for angle, text in ((-1.6, "one sole is .* cm above the other"), (9.0, "beyond its range")):
        qpos = standing.qpos.copy()
        qpos[10, knee] = angle
        with pytest.raises(ConfigError, match=text):
            reference_from(replace(standing, qpos=qpos), robot, "test")


@pytest.mark.parametrize(
    ("entry", "value", "text"),
    [
        (0, 1e200, ("qpos", "10000")),
        (9, np.nan, ("qpos", "10000")),
        (5, 1e3, ("qpos", "3", "1")),
        (3, 0.0, ("qpos", "3", "0")),
    ],
)
def test_postures_that_are_none(
    standing: RobotClip, tmp_path: Path, entry: int, value: float, text: tuple[str, ...]
) -> None:
    """What a file holds beyond what a robot can be, or no rotation, is one line."""
    qpos = standing.qpos.copy()
    qpos[3, 3:7] = 1.0, 0.0, 0.0, 0.0
    qpos[3, entry] = value
    write_robot_clip(replace(standing, qpos=qpos), tmp_path / "clip.npz")
    with invalid(*text):
        read_robot_clip(tmp_path / "clip.npz")


def test_damaged_files_are_one_line(standing: RobotClip, tmp_path: Path) -> None:
    path = tmp_path / "damaged.npz"
    with pytest.raises(ConfigError, match="must be the name of a .npz file"):
        write_robot_clip(standing, tmp_path / "still.json")
    write_robot_clip(standing, path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for _ in range(60):
        data = bytearray(whole)
        for at in rng.integers(len(data), size=int(rng.integers(1, 9))):
            data[at] = int(rng.integers(256))
        path.write_bytes(bytes(data[: int(rng.integers(len(data) // 2, len(data) + 1))]))
        try:
            read_robot_clip(path)
        except PoiseError as error:
            assert "damaged.npz" in str(error) and "\n" not in str(error)
