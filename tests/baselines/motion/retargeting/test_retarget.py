"""Retargeting: planted soles, limits, directions; what cannot be done is said."""

from dataclasses import replace

import mink
import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.postures import LevelKinematics
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.retargeting.limbs import LimbVector, find_limbs
from poise.baselines.motion.retargeting.retarget import Retargeted, retarget
from poise.baselines.motion.retargeting.targets import (
    BodyTargets,
    between_standing,
    clip_targets,
    standing_targets,
)
from poise.baselines.motion.retargeting.tasks import PointTask, SegmentTask
from poise.configs.errors import ConfigError
from tests.support.captures import make
from tests.support.physics import robot_named
from tests.support.shared import robot


@pytest.fixture(scope="module")
def squat() -> Clip:
    return read_bvh(find_bvh("humanoid_squat")).clip.cut(0.8, 2.0)


@pytest.fixture(scope="module")
def made(squat: Clip) -> Retargeted:
    return retarget(squat, robot_named("compact"), lead=0.5)


def test_soles_stay_and_limits_hold(made: Retargeted) -> None:
    """The soles' error is measured again, from the postures, by kinematics of their own."""
    robot = robot_named("compact")
    kinematics, worst = LevelKinematics(robot), 0.0
    for qpos in made.clip.qpos:
        kinematics.data.qpos[:] = qpos
        places = _soles(kinematics, qpos)
        worst = max(worst, float(np.abs(places - _soles(kinematics, robot.standing_qpos)).max()))
    assert worst < 1e-3 and made.sole_error < 1e-3
    joints = made.clip.qpos[:, 7:]
    assert np.all(joints >= robot.joint_range[:, 0]) and np.all(joints <= robot.joint_range[:, 1])
    assert made.limit_excess == 0.0


def _soles(kinematics: LevelKinematics, qpos: np.ndarray) -> np.ndarray:
    robot, data = kinematics.robot, kinematics.data
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    return np.array(
        [data.xpos[s.body_id] + data.xmat[s.body_id].reshape(3, 3) @ s.position
         for s in robot.soles]
    )  # fmt: skip


def test_the_body_does_what_the_clip_shows(made: Retargeted, squat: Clip) -> None:
    robot = robot_named("compact")
    assert max(made.direction_error.values()) < np.radians(8.0)
    low = squat.root[:, 2].min() / squat.root[:, 2].max()
    assert low < 0.8  # it is a squat
    heights = made.clip.qpos[:, 2]
    assert heights.min() < 0.9 * heights.max()
    first, last = made.clip.qpos[0, 7:], made.clip.qpos[-1, 7:]
    assert np.abs(first - robot.standing_qpos[7:]).max() < 0.05
    assert np.abs(last - robot.standing_qpos[7:]).max() < 0.05


def test_it_is_a_reference_motion(made: Retargeted) -> None:
    robot = robot_named("compact")
    motion = reference_from(made.clip, robot, "test")
    frame = len(made.clip.qpos) // 2
    sample = motion.sample(frame * made.clip.dt)
    assert sample.q_ref == pytest.approx(made.clip.qpos[frame, 7:], abs=1e-9)
    assert motion.sample(0.0).v_ref == pytest.approx(np.zeros(len(robot.joint_names)), abs=1e-9)
    with pytest.raises(ConfigError, match="is a motion of the robot 'compact', not of 'tall'"):
        reference_from(made.clip, robot_named("tall"), "test")


def test_height_is_in_proportion_to_the_legs(squat: Clip) -> None:
    targets = clip_targets(squat, arms=True, smooth=100.0)
    doubled = clip_targets(_scaled(squat, 2.0), arms=True, smooth=100.0)
    assert doubled.height == pytest.approx(targets.height, abs=1e-9)
    assert doubled.directions["trunk"] == pytest.approx(targets.directions["trunk"], abs=1e-9)


def _scaled(clip: Clip, factor: float) -> Clip:
    skeleton = replace(clip.skeleton, offsets=clip.skeleton.offsets * factor,
                       end_offsets=clip.skeleton.end_offsets * factor)  # fmt: skip
    return replace(clip, skeleton=skeleton, root=clip.root * factor)


def test_ways_begin_at_standing_and_meet_the_clip(squat: Clip) -> None:
    robot = robot_named("humanoid")
    standing = standing_targets(find_limbs(robot))
    targets = clip_targets(squat, arms=True, smooth=3.0)
    whole = between_standing(targets, standing, 1.0)
    for name, values in whole.directions.items():
        assert np.linalg.norm(values, axis=1) == pytest.approx(1.0)
        assert values[0] == pytest.approx(standing.directions[name][0])
        turns = np.arccos(np.clip((values[1:] * values[:-1]).sum(axis=1), -1, 1))
        assert turns.max() < np.radians(20.0)  # a frame: no jump
    assert whole.height[0] == 1.0 == whole.height[-1]


@pytest.mark.parametrize("rest", [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [-1.0, 0.0, 0.0]])
def test_the_way_between_opposite_directions_is_a_half_circle(rest: list[float]) -> None:
    """Of unit vectors, each as far from the next one as eased; through x, or z if it is along x."""
    standing = BodyTargets({"forearm": np.array([rest])}, np.ones(1))
    clip = BodyTargets({"forearm": -np.array([rest, rest])}, np.ones(2))
    way = between_standing(clip, standing, 1.0).directions["forearm"]
    assert np.linalg.norm(way, axis=1) == pytest.approx(1.0)
    turns = np.arccos(np.clip((way[1:31] * way[:30]).sum(axis=1), -1, 1))
    assert turns.sum() == pytest.approx(np.pi) and turns.max() < np.radians(12.0)


@pytest.mark.parametrize("kind", ["segments", "height"])
def test_jacobians_are_the_derivatives_of_the_errors(kind: str, squat: Clip) -> None:
    robot = robot_named("humanoid")
    limbs = find_limbs(robot)
    targets = clip_targets(squat, arms=True, smooth=3.0)
    task = PointTask(LimbVector(limbs.points["pelvis"], limbs.points["feet"]), 1.0, axes=[2])
    if kind == "segments":
        task = SegmentTask(limbs, list(targets.directions))
        task.aim(targets.directions, 5)
    configuration = mink.Configuration(robot.model, q=robot.standing_qpos)
    jacobian, error = task.compute_jacobian(configuration), task.compute_error(configuration)
    direction = np.random.default_rng(1).normal(size=robot.model.nv)
    configuration.integrate_inplace(direction, 1e-6)
    change = (task.compute_error(configuration) - error) / 1e-6
    assert change == pytest.approx(jacobian @ direction, abs=1e-4)


def test_what_cannot_be_followed_is_said(squat: Clip) -> None:
    robot = robot_named("compact")
    with pytest.raises(ConfigError, match="smooth: must be above 0"):
        retarget(squat, robot, smooth=0.0)
    with pytest.raises(ConfigError, match="at least 0.23 s are needed"):
        retarget(squat.cut(0.0, 0.1), robot)


@pytest.mark.parametrize("name", [
    "unitree_g1", *(pytest.param(name, marks=pytest.mark.weekly) for name in (
        "unitree_h1", "booster_t1"))])  # fmt: skip
def test_public_robots_take_clips(name: str) -> None:
    """With soles that stay, though the ankles of the G1 are just above the floor."""
    made = retarget(read_bvh(find_bvh("humanoid_wave")).clip.cut(0.0, 2.0), robot(name))
    assert made.sole_error < 1e-3 and made.limit_excess == 0.0 and made.penetration < 1e-3


def test_legs_without_room_stay_on_their_soles() -> None:
    """A sitting clip folds the H1's hips and ankles, which only pitch, up to their limits, where
    planting a posture anew moves it by decimetres."""
    made = retarget(make("sit")[0].cut(1.0, 3.0), robot("unitree_h1"))
    fastest = np.abs(np.diff(made.clip.qpos[:, 7:], axis=0)).max() / made.clip.dt
    assert made.sole_error < 1e-3 and made.limit_excess == 0.0 and fastest < 5.0  # [rad/s]
