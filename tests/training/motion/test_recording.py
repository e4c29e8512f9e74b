"""The packaged clips are what Poise records, bit for bit, and the humanoid's own motion."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_steps
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh, packaged_clips
from poise.configs.files import packaged_folder
from poise.training.motion import recording
from tests.support.physics import robot_named

NAMES = ("kick", "punch", "reach_down", "reach_up", "squat", "stand", "step_in_place", "walk",
         "wave")  # fmt: skip


def packaged_clip(name: str) -> Clip:
    return read_bvh(find_bvh(f"humanoid_{name}")).clip


def test_the_command_makes_the_packaged_clips_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording.main(tmp_path)
    assert packaged_clips() == [f"humanoid_{name}" for name in NAMES]
    for name in packaged_clips():
        made = (tmp_path / f"{name}.bvh").read_bytes()
        assert made == find_bvh(name).read_bytes(), name
    assert len(capsys.readouterr().out.splitlines()) == len(NAMES) == len(list(tmp_path.iterdir()))


@pytest.mark.parametrize("name", ["kick", "step_in_place"])
def test_joints_are_where_the_robot_has_them(name: str) -> None:
    """Knees, ankles and elbows are MuJoCo's anchors, to the file's six decimals."""
    robot, clip = robot_named("humanoid"), packaged_clip(name)
    made = load_steps(packaged_folder("motions") / f"{name}.yaml", robot)
    assert len(made.qpos) == len(clip)
    places, roles, data = clip.places(), clip.skeleton.roles, mujoco.MjData(robot.model)
    for frame in range(0, len(clip), 10):
        data.qpos[:] = made.qpos[frame]
        mujoco.mj_kinematics(robot.model, data)
        for role, joint in (("knee_left", "left_knee"), ("ankle_right", "right_ankle_y"),
                            ("elbow_left", "left_elbow")):  # fmt: skip
            gap = places[frame, roles[role]] - data.joint(joint).xanchor
            assert np.abs(gap).max() < 1e-5


def test_a_squat_lowers_the_hips_and_a_walk_goes_ahead() -> None:
    squat, walk = packaged_clip("squat"), packaged_clip("walk")
    assert np.ptp(squat.root[:, 2]) > 0.3 * squat.skeleton.leg_length
    h = robot_named("humanoid").height_com
    assert walk.root[-1, 0] - walk.root[0, 0] == pytest.approx(0.6 * h, abs=1e-3)
