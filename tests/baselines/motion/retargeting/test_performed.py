"""Clips joined on a robot become its motion: planted soles, limits, standing at both ends."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import read_robot_clip, write_robot_clip
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.graphs.joining.joins import insert
from poise.baselines.motion.retargeting.performed import load_clip, robot_clip_of
from poise.baselines.motion.retargeting.retarget import retarget
from poise.baselines.motion.retargeting.robot_bvh import clip_of_robot, robot_qpos
from poise.configs.errors import ConfigError
from tests.support.physics import robot_named


@cache
def squat() -> Clip:
    """A second of squatting, of the humanoid, as far as it goes down."""
    made = retarget(
        read_bvh(find_bvh("humanoid_squat")).clip.cut(1.0, 2.0), robot_named("humanoid")
    )
    robot = robot_named("humanoid")
    return clip_of_robot(robot, made.clip.qpos, made.clip.dt, "squat")


def sole_gap(qpos: np.ndarray) -> float:
    """Largest distance of a sole's origin from where it is in standing [m]."""
    robot, data, largest = robot_named("humanoid"), None, 0.0
    data = mujoco.MjData(robot.model)

    def places(q: np.ndarray) -> np.ndarray:
        data.qpos[:] = q
        mujoco.mj_kinematics(robot.model, data)
        return np.array([data.xpos[sole.body_id] for sole in robot.soles])

    wanted = places(robot.standing_qpos).copy()
    for q in qpos:
        largest = max(largest, float(np.abs(places(q) - wanted).max()))
    return largest


def test_what_fits_already_stays_as_it_is() -> None:
    """Wherever the clip has wandered and turned, the joints are the same and the soles at home."""
    robot = robot_named("humanoid")
    moved = squat().turned(0.5).moved(np.array([2.0, -1.0, 0.0]))
    made = robot_clip_of(moved, robot, "squat")
    own = robot_qpos(squat(), robot)
    assert made.qpos.shape == own.shape
    assert np.abs(made.qpos[:, 7:] - own[:, 7:]).max() < 5e-3  # the margin of the joint limits
    assert sole_gap(made.qpos) < 1e-4


def test_a_join_is_planted_within_the_limits_and_led_from_standing() -> None:
    """Bent to bent, half a second in between: no posture of the join keeps its soles by itself."""
    robot = robot_named("humanoid")
    low = squat().cut(1.2, 2.0)
    whole = insert(low, low.reversed(), 0.6)
    raw = robot_qpos(whole, robot)
    made = robot_clip_of(whole, robot, "twice", "a script")
    assert sole_gap(made.qpos) < 0.02 * sole_gap(raw)
    assert np.array_equal(made.qpos[0], robot.standing_qpos)
    assert np.array_equal(made.qpos[-1], robot.standing_qpos)
    assert len(made.qpos) > len(raw) + 20  # two leads
    low_limit, high_limit = robot.joint_range.T
    assert np.all(made.qpos[:, 7:] > low_limit) and np.all(made.qpos[:, 7:] < high_limit)
    assert np.abs(np.diff(made.qpos[:, 7:], axis=0)).max() < 0.25
    assert made.about.source == "a script" and made.about.robot == "humanoid"


def test_files_of_clips(tmp_path: Path) -> None:
    robot = robot_named("humanoid")
    path = tmp_path / "squat.npz"
    write_robot_clip(robot_clip_of(squat(), robot, "squat"), path)
    clip, digest = load_clip(path, robot)
    assert robot_qpos(clip, robot) == pytest.approx(read_robot_clip(path).qpos, abs=1e-9)
    assert digest.startswith("sha256:") and clip.name == "squat"
    plain, other = load_clip("humanoid_stand")
    assert len(plain.skeleton.names) == 20 and other != digest
    with pytest.raises(ConfigError, match=r"is a robot's motion: say which robot's \(--robot\)"):
        load_clip(path)
    with pytest.raises(ConfigError, match=r"not of 'compact' \(--robot humanoid\)"):
        load_clip(path, robot_named("compact"))
    broken = replace(squat(), rotations=squat().rotations[:, ::-1].copy())
    with pytest.raises(ConfigError, match="turns by .* beside its axis"):
        robot_clip_of(broken, robot, "broken")
