"""baselines/policy_files/motion/track.py: what terms show of a motion, laid where the robot is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.policy_files.config import ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.motion.clips import FrameClip
from poise.baselines.policy_files.motion.config import MotionConfig
from poise.baselines.policy_files.motion.track import MOTION_ALIASES, MOTION_TERMS, MotionTrack
from poise.baselines.policy_files.observations import Observer, tracks_motion
from poise.baselines.policy_files.terms import Seen
from poise.envs.physics.simulation import Simulation
from tests.support.refused import invalid
from tests.support.shared import robot

BODY, PERIOD, COUNT = robot("compact"), 0.02, 9
NAMES = list(BODY.joint_names)
INDEX = np.array([4, 0, 20])  # the policy's joints
DEFAULT = np.array([0.1, -0.2, 0.3])
ANCHOR = next(name for name in (BODY.model.body(i).name for i in range(BODY.model.nbody))
              if "torso" in name or "chest" in name or "trunk" in name)  # fmt: skip


def clip() -> FrameClip:
    """A robot that goes ahead, turns, leans and bends its waist."""
    t = np.arange(COUNT)[:, None] * PERIOD
    turn = Rotation.from_euler("ZYX", np.hstack([0.4 + 2.0 * t, 0.3 + t, -0.2 + 0.5 * t]))
    root = np.hstack([1.0 + 0.5 * t, -2.0 + 0.2 * t, 0.8 + 0.1 * t])
    q = BODY.standing_qpos[7:] + 0.3 * np.sin(5.0 * t + np.arange(len(NAMES)))
    qpos = np.hstack([root, turn.as_quat()[:, [3, 0, 1, 2]], q])
    return FrameClip("own", PERIOD, qpos, np.gradient(q, PERIOD, axis=0))


def state(seed: int = 0) -> Any:
    """A robot elsewhere, which faces another way and leans."""
    rng = np.random.default_rng(seed)
    qpos = BODY.standing_qpos.copy()
    qpos[:2], qpos[7:] = [-3.0, 5.0], qpos[7:] + rng.normal(0.0, 0.2, len(NAMES))
    qpos[3:7] = Rotation.from_euler("ZYX", [2.5, 0.1, 0.15]).as_quat()[[3, 0, 1, 2]]
    simulation = Simulation(BODY)
    return simulation.reset(qpos, np.zeros(BODY.model.nv))


def pose(qpos: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Of the anchor, by MuJoCo."""
    simulation = Simulation(BODY)
    simulation.reset(qpos, np.zeros(BODY.model.nv))
    data, body = simulation.data, BODY.model.body(ANCHOR).id
    return data.xpos[body].copy(), Rotation.from_matrix(data.xmat[body].reshape(3, 3))


def track(**fields: Any) -> MotionTrack:
    config = MotionConfig(anchor=ANCHOR, **{"plays": True, **fields})
    return MotionTrack(BODY, config, clip(), INDEX, DEFAULT)


def shown(term: ObservationTerm, motion: MotionTrack, now: Any) -> np.ndarray:
    config = PolicyFileConfig(observations=(term,))
    names = [NAMES[i] for i in INDEX]
    seen = Seen(now, now.q[INDEX], now.qvel[6:][INDEX], DEFAULT, np.zeros(3), np.zeros(3), 0.0,
                np.zeros(2), motion)  # fmt: skip
    return Observer(config, names, names, "own.yaml").observe(seen)[""]


def laid(heading: str = "anchor") -> tuple[Rotation, np.ndarray]:
    """The turn about the vertical and the shift that bring the first frame to the robot."""
    frames, (here, facing), (there, faced) = clip().qpos, pose(state().qpos), pose(clip().qpos[0])
    own = faced if heading == "anchor" else Rotation.from_quat(frames[0, [4, 5, 6, 3]])
    turn = Rotation.from_euler("z", facing.as_euler("ZYX")[0] - own.as_euler("ZYX")[0])
    return turn, (here - turn.apply(there)) * [1.0, 1.0, 0.0]


@pytest.mark.parametrize("heading", ["anchor", "root"])
def test_terms_mean_what_trackers_see(heading: str) -> None:
    """Of the frame now and of the robot as it is now, at another place than when it began."""
    motion, step = track(heading=heading), 4
    motion.begin(state())
    now = state(1)
    motion.update(now, step)
    frames, (turn, shift) = clip(), laid(heading)
    q, v = frames.qpos[step, 7:][INDEX], frames.velocities[step, INDEX]
    here, facing = pose(now.qpos)
    there, faced = pose(frames.qpos[step])
    root = turn * Rotation.from_quat(frames.qpos[step, [4, 5, 6, 3]])
    before, after = (Rotation.from_quat(frames.qpos[i, [4, 5, 6, 3]]) for i in (step - 1, step + 1))
    speed = turn.apply((frames.qpos[step + 1, :3] - frames.qpos[step - 1, :3]) / (2 * PERIOD))
    _, pitch, roll = root.as_euler("ZYX")
    expected = {
        "motion_command": [*q, *v],
        "motion_joint_pos": q,
        "motion_joint_pos_rel": q - DEFAULT,
        "motion_joint_vel": v,
        "motion_anchor_pos_b": facing.inv().apply(turn.apply(there) + shift - here),
        "motion_anchor_ori_b": (facing.inv() * turn * faced).as_matrix()[:, :2].ravel(),
        "motion_root_height": [frames.qpos[step, 2]],
        "motion_root_roll_pitch": [roll, pitch],
        "motion_root_lin_vel": root.inv().apply(speed),
        "motion_root_ang_vel": (before.inv() * after).as_rotvec() / (2 * PERIOD),
        "motion_gravity": root.inv().apply([0.0, 0.0, -1.0]),
        "motion_phase": [step / (COUNT - 1)],
        "time_step": [step],
    }
    assert list(expected) == list(MOTION_TERMS)
    for name, value in expected.items():
        found = shown(ObservationTerm(name), motion, now)
        np.testing.assert_allclose(found, value, atol=1e-6, err_msg=name)
    for alias, name in MOTION_ALIASES.items():
        np.testing.assert_array_equal(*(shown(ObservationTerm(n), motion, now)
                                        for n in (alias, name)))  # fmt: skip


def test_frames_ahead_and_behind_lie_side_by_side() -> None:
    """The first and the last frame are held; scales are alike for all frames, or one for each."""
    motion, now = track(), state()
    motion.begin(now)
    motion.update(now, 1)
    q = clip().qpos[:, 7:][:, INDEX]
    term = ObservationTerm("motion_joint_pos", ahead=(-5, 0, 2, 100), scale=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(shown(term, motion, now),
                               (q[[0, 1, 3, COUNT - 1]] * [1.0, 2.0, 3.0]).ravel())  # fmt: skip
    picked = ObservationTerm("motion_joint_pos", ahead=(0, 1), pick=(2,), scale=(1.0, 10.0))
    np.testing.assert_allclose(shown(picked, motion, now), [q[1, 2], 10.0 * q[2, 2]])
    with invalid("observations[0].ahead"):
        shown(ObservationTerm("joint_pos", ahead=(1,)), motion, now)


def test_a_clip_that_is_not_played_stands() -> None:
    """Its first frame, without velocities, whatever the step."""
    motion, now = track(plays=False), state()
    motion.begin(now)
    motion.update(now, 5)
    command = shown(ObservationTerm("motion_command"), motion, now)
    np.testing.assert_allclose(command, [*clip().qpos[0, 7:][INDEX], 0.0, 0.0, 0.0])
    for name in ("motion_root_lin_vel", "motion_root_ang_vel", "time_step"):
        np.testing.assert_array_equal(shown(ObservationTerm(name), motion, now), 0.0)


def test_a_tracker_is_one_whose_terms_show_a_motion() -> None:
    """Within frames and in any input."""
    inner = ObservationTerm(frame=(ObservationTerm("time_step"),), history=2)
    assert tracks_motion(PolicyFileConfig(observations={"a": (inner,)}))
    assert not tracks_motion(PolicyFileConfig(observations=(ObservationTerm("phase"),)))
