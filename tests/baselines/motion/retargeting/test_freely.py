"""Captures of any kind: contacts against made ones, and what a robot does of them by kinematics."""

from __future__ import annotations

import functools
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.footing import root_turns, sole_poses
from poise.baselines.balance.references.robot_clip import (
    RobotClip,
    read_robot_clip,
    reference_from,
    write_robot_clip,
)
from poise.baselines.motion.clips.axes import named_axes
from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts, over_ground
from poise.baselines.motion.retargeting.retarget import Retargeted, retarget_freely
from poise.baselines.motion.space_time.retarget_clip import retarget_clip
from poise.configs.errors import ConfigError
from tests.support.captures import CAPTURES, make
from tests.support.physics import robot_named
from tests.support.weekly import daily

EXTRA = Path(__file__).parents[5] / "shared" / "motions" / "extra"
UNITS = (1.0, 0.01, 0.0254)


@functools.cache
def written(name: str) -> tuple[Clip, np.ndarray]:
    """A made capture as it is read from a file, and its contacts."""
    clip, truth = make(name)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.bvh"
        write_bvh(clip, path, named_axes("y", "z", UNITS[len(name) % 3]))
        return read_bvh(path).clip, truth


@functools.cache
def freely(name: str) -> Retargeted:
    """A made capture on the robot."""
    return retarget_freely(written(name)[0], robot_named("humanoid"))


def check_soles(name: str, made: RobotClip) -> None:
    """Planted soles rest within 1 cm and at 1 cm/s at most, and nothing is in the floor."""
    robot = robot_named("humanoid")
    assert made.planted is not None
    _, places, turns = sole_poses(robot, made.qpos)
    for foot in range(2):
        down = made.planted[:, foot]
        both = down[1:] & down[:-1]
        assert np.abs(places[down, foot, 2]).max() < 0.01, name
        assert np.linalg.norm(np.diff(places[:, foot], axis=0)[both], axis=1).max() < 0.01 / 30
        normals = Rotation.from_rotvec(turns[down, foot]).apply([0.0, 0.0, 1.0])
        assert np.abs(normals[:, :2]).max() < 0.02
        assert places[:, foot, 2].min() > -0.005
    data = mujoco.MjData(robot.model)
    for qpos in made.qpos[::10]:
        data.qpos[:] = qpos
        mujoco.mj_forward(robot.model, data)
        assert data.contact.dist.min(initial=0.0) > -0.02
    low, high = robot.joint_range.T
    assert np.all(made.qpos[:, 7:] > low - 1e-9) and np.all(made.qpos[:, 7:] < high + 1e-9)


@pytest.mark.parametrize("name", daily(CAPTURES, 3))
def test_made_captures(name: str) -> None:
    """Contacts agree in 95 % of the frames, and soles rest where they are planted."""
    clip, truth = written(name)
    assert np.mean(measure_contacts(clip).planted == truth) > 0.95
    check_soles(name, freely(name).clip)


@pytest.mark.parametrize("name", ["cmu02_jump", "cmu_12_01_walk", "cmu_jumping_jacks",
                                  "fair1_jumping", "makehuman_walk1"])  # fmt: skip
def test_captures_of_others(name: str) -> None:
    path = EXTRA / f"{name}.bvh"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    clip = read_bvh(path).clip
    check_soles(name, retarget_freely(clip, robot_named("humanoid")).clip)
    flies = not measure_contacts(clip).planted.any(axis=1).all()
    assert flies == ("jump" in name)


#: first frame of every stance and first after it, left and right, marked by hand: from the heights
#: and speeds of toes and heels, before what is tested was asked
MARKED = {
    "cmu_12_01_walk": ([(0, 50), (103, 200), (256, 356), (411, 518)],
                       [(20, 126), (177, 276), (330, 433), (488, 523)]),
    "cmu02_jump": ([(0, 28), (45, 73)], [(0, 28), (45, 73)]),
}  # fmt: skip


@pytest.mark.parametrize("name", MARKED)
def test_contacts_agree_with_those_marked_by_hand(name: str) -> None:
    path = EXTRA / f"{name}.bvh"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    found = measure_contacts(read_bvh(path).clip).planted
    marked = np.zeros_like(found)
    for foot, stances in enumerate(MARKED[name]):
        for begin, end in stances:
            marked[begin:end, foot] = True
    assert np.mean(found == marked) > 0.95


def test_the_heading_and_the_way_go_with_the_clip() -> None:
    """A circle of 6.6 rad, its way the legs' ratio as long."""
    (clip, _), made = written("circle"), freely("circle")
    w, x, y, z = made.clip.qpos[:, 3:7].T
    yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    assert yaw[-1] - yaw[0] == pytest.approx(np.ptp(np.unwrap(clip.facing())), abs=0.1)
    across = np.ptp(made.clip.qpos[:, 1])
    assert across == pytest.approx(made.scale * np.ptp(clip.root[:, 1]), rel=0.05)
    assert made.stride == 1.0


def test_a_leap_leaves_the_ground_when_the_clip_does() -> None:
    robot, (clip, truth) = robot_named("humanoid"), written("jump")
    made = retarget_clip(clip, robot, kinematic=True).clip
    assert made.planted is not None
    flight = np.flatnonzero(~made.planted.any(axis=1)) * made.dt
    truly = np.flatnonzero(~truth.any(axis=1)) * clip.dt
    assert flight[[0, -1]] == pytest.approx(truly[[0, -1]], abs=0.05)
    assert np.abs(root_turns(robot, made.qpos)).max() < 0.5


def test_a_run_is_seen_but_not_performed(tmp_path: Path) -> None:
    robot, (clip, _) = robot_named("humanoid"), written("run")
    made = retarget_clip(clip, robot).clip
    assert made.planted is not None
    write_robot_clip(made, tmp_path / "run.npz")
    again = read_robot_clip(tmp_path / "run.npz")
    assert np.array_equal(again.planted, made.planted) and again.about == made.about
    with pytest.raises(ConfigError, match=r"x: motion: can be seen, but not performed: both feet"):
        reference_from(again, robot, "x")
    with pytest.raises(ConfigError, match="off the ground for .* from one foot"):
        retarget_clip(clip, robot, kinematic=False)


def test_a_walk_on_a_treadmill_goes_on() -> None:
    clip, truth = written("walk")
    still = replace(clip, root=clip.root - clip.times[:, None] * [1.2, 0.0, 0.0])
    assert over_ground(still).root == pytest.approx(clip.root, abs=0.05)
    assert over_ground(clip) is clip
    assert np.mean(measure_contacts(still).planted == truth) > 0.95


def test_a_rest_pose_before_the_clip_is_left_out(tmp_path: Path) -> None:
    clip, _ = written("walk")
    rest = np.zeros_like(clip.rotations[:1])
    rest[..., 0] = 1.0
    longer = replace(clip, root=np.concatenate([np.zeros((1, 3)), clip.root]),
                     rotations=np.concatenate([rest, clip.rotations]))  # fmt: skip
    write_bvh(longer, tmp_path / "longer.bvh")
    assert len(read_bvh(tmp_path / "longer.bvh").clip) == len(clip)
