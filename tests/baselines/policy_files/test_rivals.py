"""configs/rivals: each description says what its maker's loop does, which is written here apart.

The loops are NumPy, MuJoCo and the network alone, from each project's contract in words.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.files import packaged, resolve
from poise.configs.reading import read_yaml
from poise.envs.robots.menagerie import WHEEL
from poise.envs.robots.robot import Robot
from tests.support.policies import onnx_session
from tests.support.rivals import KNOWN, allowed, network
from tests.support.shared import robot as shared_robot

STEPS, SUBSTEPS = 200, 10
SHAKY = {"push": [], "noise": 1.0}
LEGS = [f"{side}_{joint}" for side in ("left", "right") for joint in (
    "hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")]  # fmt: skip
WAIST = ["waist_yaw", "waist_roll", "waist_pitch"]
ARMS = [f"{side}_{joint}" for side in ("left", "right") for joint in (
    "shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch",
    "wrist_yaw")]  # fmt: skip
G1 = [f"{name}_joint" for name in LEGS + WAIST + ARMS]
T1_ARM = ["Shoulder_Pitch", "Shoulder_Roll", "Elbow_Pitch", "Elbow_Yaw"]
T1_LEG = ["Hip_Pitch", "Hip_Roll", "Hip_Yaw", "Knee_Pitch", "Ankle_Pitch", "Ankle_Roll"]
T1 = ["AAHead_yaw", "Head_pitch", *(f"{s}_{j}" for s in ("Left", "Right") for j in T1_ARM), "Waist",
      *(f"{s}_{j}" for s in ("Left", "Right") for j in T1_LEG)]  # fmt: skip
H1_LEG = ["hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle"]
H1_ARM = ["shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow"]
H1 = [*(f"{s}_{j}" for s in ("left", "right") for j in H1_LEG), "torso",
      *(f"{s}_{j}" for s in ("left", "right") for j in H1_ARM)]  # fmt: skip
KP = [100, 100, 100, 200, 20, 20] * 2 + [300] * 3 + [90, 60, 20, 60, 4, 4, 4] * 2
KD = [2.5, 2.5, 2.5, 5, 0.2, 0.1] * 2 + [5] * 3 + [2, 1, 0.4, 1, 0.2, 0.2, 0.2] * 2
CROUCH = [-0.1, 0, 0, 0.3, -0.2, 0] * 2 + [0] * 17
BENT = [-0.312, 0, 0, 0.669, -0.363, 0] * 2 + [0] * 3 + [0.2, 0.2, 0, 0.6, 0, 0, 0] + [
    0.2, -0.2, 0, 0.6, 0, 0, 0]  # fmt: skip


class Now(NamedTuple):
    """What a loop knows in a step; joints in the order of the policy."""

    gyro: np.ndarray
    gravity: np.ndarray  # its direction, the root's axes
    velocity: np.ndarray  # of the root, its axes
    roll_pitch: np.ndarray
    q: np.ndarray
    v: np.ndarray
    action: np.ndarray  # of the step before
    step: int
    turn: Rotation  # of the root


class Loop(NamedTuple):
    """A maker's loop: joints, posture, gains, how the action moves them, and what it observes."""

    joints: list[str]
    default: Any
    kp: Any
    kd: Any
    scale: Any
    observe: Callable[[Now], np.ndarray]
    moved: list[int] | None = None
    held: Any = None
    bound: float = np.inf
    adds: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None  # of roll, pitch and gyro
    grown: float = 1e-4  # rounding after 200 steps; more where the robot rocks on short heels


def frame(*parts: Any) -> np.ndarray:
    return np.concatenate([np.atleast_1d(np.asarray(part, dtype=float)) for part in parts])


def falcon() -> Loop:
    """Terms by the alphabet; five steps, oldest first, zeros before the first."""
    past = deque([np.zeros(115)] * 5, maxlen=5)

    def observe(n: Now) -> np.ndarray:
        past.append(frame(n.action, 0.25 * n.gyro, 0, 2 * 0.75, [0, 0], 0, [0, 0, 0], n.q - CROUCH,
                          0.05 * n.v, n.gravity, np.zeros(14)))  # fmt: skip
        return np.concatenate(past)

    return Loop(G1, CROUCH, KP, KD, 0.25, observe)


def falcon_loco() -> Loop:
    """Stand flag 0; its clock stands at zero: cosine 1, sine 0."""

    def observe(n: Now) -> np.ndarray:
        return frame(n.action, 0.25 * n.gyro, 0, [0, 0], 0, [0, 0, 0], 1, n.q - CROUCH, 0.05 * n.v,
                     n.gravity, np.zeros(14), 0)  # fmt: skip

    return Loop(G1, CROUCH, KP, KD, 0.25, observe, moved=list(range(15)))


def asap() -> Loop:
    """Four past steps of each term, newest first, between the two halves of this one."""
    arms = [0, 0.3, 0, 1, 0, 0, 0] + [0, -0.3, 0, 1, 0, 0, 0]
    upper, sizes = [0, 0, 0, *arms], [12, 3, 1, 1, 2, 1, 1, 29, 29, 3, 17, 1]
    past = deque([[np.zeros(size) for size in sizes]] * 4, maxlen=4)

    def observe(n: Now) -> np.ndarray:
        now = [frame(part) for part in (
            n.action, 0.25 * n.gyro, 0, 2 * 0.78, [0, 0], 0, 1, n.q - CROUCH, 0.05 * n.v, n.gravity,
            upper, 0)]  # fmt: skip
        before = [old for term in zip(*past, strict=True) for old in term]
        past.appendleft(now)
        return frame(*now[:9], *before, *now[9:])

    kp = KP[:12] + [400] * 3 + KP[15:]
    held = CROUCH[:12] + upper
    return Loop(G1, CROUCH, kp, KD, 0.25, observe, list(range(12)), held)


def holosoma() -> Loop:
    """At zero command the phases of both legs are π."""
    hip, knee, ankle, arm, wrist = (
        40.179238471,
        99.098427777,
        28.501246196,
        14.250623098,
        16.778327481,
    )
    kp = (
        [hip, knee, hip, knee, ankle, ankle] * 2
        + [hip, ankle, ankle]
        + ([arm] * 5 + [wrist] * 2) * 2
    )
    hip, knee, ankle, arm, wrist = 2.557889765, 6.308801854, 1.814445687, 0.907222843, 1.068141502
    kd = (
        [hip, knee, hip, knee, ankle, ankle] * 2
        + [hip, ankle, ankle]
        + ([arm] * 5 + [wrist] * 2) * 2
    )

    def observe(n: Now) -> np.ndarray:
        return frame(n.action, 0.25 * n.gyro, 0, [0, 0], np.cos([np.pi, np.pi]), n.q - BENT,
                     0.05 * n.v, n.gravity, [0, 0])  # fmt: skip

    return Loop(G1, BENT, kp, kd, 0.25, observe)


def launcher() -> Loop:
    """Isaac Lab's order of joints; it knows the velocity of the root."""
    pairs = ["hip_pitch", "hip_roll", "hip_yaw", "knee", "shoulder_pitch", "ankle_pitch",
             "shoulder_roll", "ankle_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch",
             "wrist_yaw"]  # fmt: skip
    order = [f"{s}_{j}_joint" for j in pairs for s in ("left", "right")]
    for place, name in ((2, "yaw"), (5, "roll"), (8, "pitch")):
        order.insert(place, f"waist_{name}_joint")
    default = [dict(zip(G1, BENT, strict=True))[name] for name in order]
    kp = [_of(name, hip_roll=99.1, knee=99.1, hip=40.18, waist_yaw=40.18, waist=28.5, ankle=28.5,
              wrist_roll=14.25, wrist=16.78, other=14.25) for name in order]  # fmt: skip
    kd = [_of(name, hip_roll=6.309, knee=6.309, hip=2.558, waist_yaw=2.558, waist=1.814,
              ankle=1.814, wrist_roll=0.907, wrist=1.068, other=0.907)
          for name in order]  # fmt: skip
    scale = [_of(name, hip_roll=0.351, knee=0.351, hip=0.548, waist_yaw=0.548, wrist_roll=0.439,
                 wrist=0.075, other=0.439) for name in order]  # fmt: skip

    def observe(n: Now) -> np.ndarray:
        return frame(n.velocity, n.gyro, n.gravity, [0, 0, 0], n.q - default, n.v, n.action)

    return Loop(order, default, kp, kd, scale, observe)


def _of(name: str, **values: float) -> float:
    """The value of the first part that a joint's name has."""
    return next(value for part, value in values.items() if part in name or part == "other")


def playground_g1() -> Loop:
    """Its clock of two legs runs at 1.5 Hz, always; cosines, then sines."""
    default = [*BENT[:14], 0.073, *BENT[15:]]
    kp = [75, 75, 75, 75, 20, 2] * 2 + [75] * 3 + [75, 75, 75, 75, 2, 2, 2] * 2
    kd = [2, 2, 2, 2, 1, 0.2] * 2 + [2] * 3 + [2, 2, 2, 2, 0.2, 0.2, 0.2] * 2

    def observe(n: Now) -> np.ndarray:
        phase = 2 * np.pi * 1.5 * 0.02 * n.step + np.array([0, np.pi])
        return frame(n.velocity, n.gyro, n.gravity, [0, 0, 0], n.q - default, n.v, n.action,
                     np.cos(phase), np.sin(phase))  # fmt: skip

    return Loop(G1, default, kp, kd, 0.5, observe)


def playground_t1() -> Loop:
    """The head reads as zero; at zero command both legs' phases are π."""
    leg = [-0.2, 0, 0, 0.4, -0.2, 0]
    default = np.array([0, 0, 0, -1.4, 0, -0.4, 0, 1.4, 0, 0.4, 0, *leg, *leg])
    kp = [20] * 10 + [50] + [30, 30, 30, 30, 10, 10] * 2
    kd = [2] * 10 + [3] * 13
    seen = np.array([0, 0] + [1] * 21)

    def observe(n: Now) -> np.ndarray:
        return frame(n.velocity, n.gyro, n.gravity, [0, 0, 0], seen * (n.q - default), seen * n.v,
                     n.action, [-1, -1], [0, 0])  # fmt: skip

    return Loop(T1, default, kp, kd, 1.0, observe)


def booster_deploy() -> Loop:
    """Ten steps side by side, oldest first, filled by the first; the head is not the policy's."""
    order = ["Left_Shoulder_Pitch", "Right_Shoulder_Pitch", "Waist", "Left_Shoulder_Roll",
             "Right_Shoulder_Roll", "Left_Hip_Pitch", "Right_Hip_Pitch", "Left_Elbow_Pitch",
             "Right_Elbow_Pitch", "Left_Hip_Roll", "Right_Hip_Roll", "Left_Elbow_Yaw",
             "Right_Elbow_Yaw", "Left_Hip_Yaw", "Right_Hip_Yaw", "Left_Knee_Pitch",
             "Right_Knee_Pitch", "Left_Ankle_Pitch", "Right_Ankle_Pitch", "Left_Ankle_Roll",
             "Right_Ankle_Roll"]  # fmt: skip
    default = np.array([0.2, 0.2, 0, -1.3, 1.3, -0.2, -0.2, 0, 0, 0, 0, -0.5, 0.5, 0, 0, 0.4, 0.4,
                        -0.2, -0.2, 0, 0])  # fmt: skip
    kp = [_of(name, Shoulder=50, Elbow=50, Ankle=50, other=200) for name in order]
    kd = [_of(name, Shoulder=1, Elbow=1, Ankle=2, other=5) for name in order]
    past: deque[np.ndarray] = deque(maxlen=10)

    def observe(n: Now) -> np.ndarray:
        now = frame(n.gyro, n.gravity, [0, 0, 0], n.q - default, n.v, n.action)
        past.extend([now] * (10 if not past else 1))
        return np.concatenate(past)

    return Loop(order, default, kp, kd, 0.25, observe)


def booster_gym() -> Loop:
    """It sees and moves the legs; actions within ±1; its clock shows zeros at zero command."""
    leg = [-0.2, 0, 0, 0.4, -0.25, 0]
    default = np.array([0, 0, 0.2, -1.35, 0, -0.5, 0.2, 1.35, 0, 0.5, 0, *leg, *leg])
    kp = [20] * 10 + [200] + [200, 200, 200, 200, 50, 50] * 2
    kd = [0.2, 0.2] + [0.5] * 8 + [5] + [5, 5, 5, 5, 3, 3] * 2

    def observe(n: Now) -> np.ndarray:
        return frame(n.gravity, n.gyro, [0, 0, 0], [0, 0], (n.q - default)[11:], 0.1 * n.v[11:],
                     np.clip(n.action, -1, 1))  # fmt: skip

    return Loop(T1, default, kp, kd, 1.0, observe, list(range(11, 23)), bound=1.0)


def unitree_gym() -> Loop:
    """It sees and moves the legs, remembers, and its clock has gone on by a step at the first."""
    kp = [100, 100, 100, 150, 40, 40] * 2 + [300] * 3 + [100, 100, 50, 50, 20, 20, 20] * 2
    kd = [2, 2, 2, 4, 2, 2] * 2 + [3] * 3 + [2, 2, 2, 2, 1, 1, 1] * 2

    def observe(n: Now) -> np.ndarray:
        phase = 2 * np.pi * (0.02 * (n.step + 1) % 0.8) / 0.8
        return frame(0.25 * n.gyro, n.gravity, [0, 0, 0], (n.q - CROUCH)[:12], 0.05 * n.v[:12],
                     n.action, np.sin(phase), np.cos(phase))  # fmt: skip

    return Loop(G1, CROUCH, kp, kd, 0.25, observe, list(range(12)))


def unitree_gym_h1() -> Loop:
    """The same for ten joints; told that it leans back, since the heel here is short."""
    default = np.array([0, 0, -0.1, 0.3, -0.2] * 2 + [0] * 9)
    kp = [150, 150, 150, 200, 40] * 2 + [300] + [100, 100, 50, 50] * 2
    kd = [2, 2, 2, 4, 2] * 2 + [6] + [2] * 8

    def observe(n: Now) -> np.ndarray:
        phase = 2 * np.pi * (0.02 * (n.step + 1) % 0.8) / 0.8
        return frame(0.25 * n.gyro, n.gravity - [0.12, 0, 0], [0, 0, 0], (n.q - default)[:10],
                     0.05 * n.v[:10], n.action, np.sin(phase), np.cos(phase))  # fmt: skip

    return Loop(H1, default, kp, kd, 0.25, observe, list(range(10)), grown=1e-3)


def twist2() -> Loop:
    """This step, the ten before it (zeros at first), and the reference again."""
    leg = [-0.2, 0, 0, 0.4, -0.2, 0]
    default = np.array(leg * 2 + [0] * 3 + [0, 0.4, 0, 1.2, 0, 0, 0] + [0, -0.4, 0, 1.2, 0, 0, 0])
    kp = [100, 100, 100, 150, 40, 40] * 2 + [150] * 3 + [40, 40, 40, 40, 4, 4, 4] * 2
    kd = [2, 2, 2, 4, 2, 2] * 2 + [4] * 3 + [5, 5, 5, 5, 0.2, 0.2, 0.2] * 2
    reference = frame([0, 0], 0.8, [0, 0], 0, default)
    past = deque([np.zeros(127)] * 10, maxlen=10)

    def observe(n: Now) -> np.ndarray:
        v = n.v.copy()
        v[[4, 5, 10, 11]] = 0.0
        now = frame(reference, 0.25 * n.gyro, n.roll_pitch, n.q - default, 0.05 * v, n.action)
        seen = frame(now, *past, reference)
        past.append(now)
        return seen

    return Loop(G1, default, kp, kd, 0.5, observe, bound=10.0)


def unitree_mjlab() -> Loop:
    """One step of everything."""
    arm = [0.35, 0.18, 0, 0.87, 0, 0, 0]
    default = [*CROUCH[:15], *arm, 0.35, -0.18, *arm[2:]]
    kp = (
        [40.2, 99.1, 40.2, 99.1, 28.5, 28.5] * 2
        + [40.2, 28.5, 28.5]
        + ([14.3] * 5 + [16.8] * 2) * 2
    )
    kd = [2.6, 6.3, 2.6, 6.3, 1.8, 1.8] * 2 + [2.6, 1.8, 1.8] + ([0.9] * 5 + [1.1] * 2) * 2
    scale = [0.55, 0.35, 0.55, 0.35, 0.44, 0.44] * 2 + [0.35, 0.44, 0.44] + (
        [0.44] * 5 + [0.07] * 2) * 2  # fmt: skip

    def observe(n: Now) -> np.ndarray:
        return frame(n.gyro, n.gravity, [0, 0, 0], n.q - default, n.v, n.action)

    return Loop(G1, default, kp, kd, scale, observe)


def unitree_mjlab_2026() -> Loop:
    """The same with a clock, which shows zeros at zero command; the waist yaws further."""
    plain = unitree_mjlab()
    scale = [*plain.scale[:12], 0.55, *plain.scale[13:]]

    def observe(n: Now) -> np.ndarray:
        return frame(n.gyro, n.gravity, [0, 0, 0], [0, 0], n.q - plain.default, n.v, n.action)

    return plain._replace(scale=scale, observe=observe)


def amp_getup() -> Loop:
    """Four whole steps, oldest first, the first one before it; it sees its action within ±10."""
    hip, knee, ankle, arm, wrist = 40.179, 99.098, 28.501, 14.251, 8.611
    kp = [knee, knee, hip, knee, ankle, ankle] * 2 + [hip, ankle, ankle] + (
        [arm] * 5 + [wrist] * 2) * 2  # fmt: skip
    hip, knee, ankle, arm, wrist = 2.5579, 6.3088, 1.8144, 0.9072, 0.5482
    kd = [knee, knee, hip, knee, ankle, ankle] * 2 + [hip, ankle, ankle] + (
        [arm] * 5 + [wrist] * 2) * 2  # fmt: skip
    hip, knee, ankle, wrist = 0.54755, 0.35066, 0.43858, 0.29033
    scale = [knee, knee, hip, knee, ankle, ankle] * 2 + [hip, ankle, ankle] + (
        [ankle] * 5 + [wrist] * 2) * 2  # fmt: skip
    past: list[np.ndarray] = []

    def observe(n: Now) -> np.ndarray:
        past.append(
            frame(n.gyro, n.gravity, [0, 0, 0], n.q - BENT, n.v, np.clip(n.action, -10, 10))
        )
        return frame(*(past[max(0, len(past) - 4 + i)] for i in range(4)))

    return Loop(G1, BENT, kp, kd, scale, observe, bound=10.0)


def unitree_lab() -> Loop:
    """Isaac Lab's order of joints, five steps of each term, oldest first, filled by the first."""
    order = [G1[i] for i in (0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17,
                             24, 18, 25, 19, 26, 20, 27, 21, 28)]  # fmt: skip
    default = np.array([-0.1, -0.1, 0, 0, 0, 0, 0, 0, 0, 0.3, 0.3, 0.3, 0.3, -0.2, -0.2, 0.25,
                        -0.25, 0, 0, 0, 0, 0.97, 0.97, 0.15, -0.15, 0, 0, 0, 0])  # fmt: skip
    kp = [_of(name, hip=100, knee=150, waist=200, other=40) for name in order]
    kd = [_of(name, hip=2, knee=4, ankle=2, waist=5, other=10) for name in order]
    past: deque[list[np.ndarray]] = deque(maxlen=5)

    def observe(n: Now) -> np.ndarray:
        now = [0.2 * n.gyro, n.gravity, np.zeros(3), n.q - default, 0.05 * n.v, n.action.copy()]
        past.extend([now] * (5 if not past else 1))
        return np.concatenate([old for term in zip(*past, strict=True) for old in term])

    return Loop(order, default, kp, kd, 0.25, observe)


def booster_deploy_law() -> Loop:
    """That of Booster with our law: on the right, rolls and yaws turn the other way round."""
    plain, law = booster_deploy(), read_yaml(resolve("rivals", "booster-deploy-t1-law"))["law"]
    own = [next((law[k] for k in law if k.strip("*") in name), {}) for name in plain.joints]
    factor = {key: np.array([each.get(key, 1.0) for each in own])
              for key in ("action", "stiffness", "damping")}  # fmt: skip
    gain = {key: np.array([each.get(key, 0.0) for each in own])
            for key in ("pitch", "pitch_rate", "roll", "roll_rate")}  # fmt: skip
    right = np.array(["Right" in name for name in plain.joints])
    turned = right & np.array(["Pitch" not in name for name in plain.joints])

    def adds(roll_pitch: np.ndarray, gyro: np.ndarray) -> np.ndarray:
        ahead = gain["pitch"] * roll_pitch[1] + gain["pitch_rate"] * gyro[1]
        aside = gain["roll"] * roll_pitch[0] + gain["roll_rate"] * gyro[0]
        return np.where(turned, -1.0, 1.0) * (ahead + np.where(right, -1.0, 1.0) * aside)

    return plain._replace(kp=plain.kp * factor["stiffness"], kd=plain.kd * factor["damping"],
                          scale=plain.scale * factor["action"], adds=adds)  # fmt: skip


def unitree_dance() -> Loop:
    """A tracker; what it follows stands in the default posture, and faces as the robot does."""
    plain = unitree_mjlab()
    faces: list[Rotation] = []

    def observe(n: Now) -> np.ndarray:
        torso = torso_of(n)
        faces.extend([] if faces else [Rotation.from_euler("z", torso.as_euler("ZYX")[0])])
        ori = (torso.inv() * faces[0]).as_matrix()
        return frame(plain.default, np.zeros(29), ori[:, :2].ravel(), n.gyro, n.q - plain.default,
                     n.v, n.action)  # fmt: skip

    return plain._replace(observe=observe)


def torso_of(n: Now) -> Rotation:
    """The torso above the waist's yaw, roll and pitch."""
    return n.turn * Rotation.from_euler("ZXY", n.q[12:15])


def holosoma_dance() -> Loop:
    """Its clip's first frame, which is within the network, is held at rest."""
    plain = holosoma()
    session = onnx_session(network("holosoma-dance-g1"))
    given = {"obs": np.zeros((1, 154), np.float32), "time_step": np.zeros((1, 1), np.float32)}
    q, quat = (each[0] for each in session.run(["joint_pos", "ref_quat_xyzw"], given))
    own = Rotation.from_quat(quat)
    faces: list[Rotation] = []

    def observe(n: Now) -> np.ndarray:
        torso = torso_of(n)
        turn = torso.as_euler("ZYX")[0] - own.as_euler("ZYX")[0]
        faces.extend([] if faces else [Rotation.from_euler("z", turn) * own])
        ori = (torso.inv() * faces[0]).as_matrix()
        return frame(np.clip(n.action, -100, 100), n.gyro, n.q - BENT, n.v, q, np.zeros(29),
                     ori[:, :2].ravel())  # fmt: skip

    return plain._replace(observe=observe, scale=1.0, bound=100.0)


def remembered(plain: Loop, past: deque, reference: np.ndarray, n: Now) -> np.ndarray:
    """What TWIST2's network sees: this step, the ten before it, and the reference again."""
    v = n.v.copy()
    v[[4, 5, 10, 11]] = 0.0
    now = frame(reference, 0.25 * n.gyro, n.roll_pitch, n.q - plain.default, 0.05 * v, n.action)
    seen = frame(now, *past, reference)
    past.append(now)
    return seen


def twist2_tracker() -> Loop:
    """Its default posture at rest, on soles as high as standing."""
    plain = twist2()
    robot = shared_robot("unitree_g1")
    data, low = mujoco.MjData(robot.model), []
    places = [robot.model.joint(name).qposadr[0] for name in plain.joints]
    for posture in (robot.standing_qpos[places], plain.default):
        data.qpos[:] = robot.standing_qpos
        data.qpos[places] = posture
        mujoco.mj_forward(robot.model, data)
        low.append(min(data.xpos[sole.body_id] [2] + (data.xmat[sole.body_id].reshape(3, 3)
                       @ sole.position)[2] for sole in robot.soles))  # fmt: skip
    height = robot.standing_qpos[2] + low[0] - low[1]
    reference = frame([0, 0], height, [0, 0], 0, plain.default)
    past = deque([np.zeros(127)] * 10, maxlen=10)

    return plain._replace(observe=lambda n: remembered(plain, past, reference, n))


LOOPS: dict[str, Callable[[], Loop]] = {
    "amp-getup-g1": amp_getup,
    "asap-loco-g1": asap,
    "booster-deploy-t1": booster_deploy,
    "booster-deploy-t1-law": booster_deploy_law,
    "booster-gym-t1": booster_gym,
    "falcon-g1": falcon,
    "falcon-loco-g1": falcon_loco,
    "holosoma-dance-g1": holosoma_dance,
    "holosoma-fastsac-g1": holosoma,
    "holosoma-ppo-g1": holosoma,
    "launcher-stance-g1": launcher,
    "playground-g1": playground_g1,
    "playground-t1": playground_t1,
    "twist2-g1": twist2,
    "twist2-tracker-g1": twist2_tracker,
    "unitree-dance-g1": unitree_dance,
    "unitree-g1-velocity": unitree_mjlab,
    "unitree-gym-g1": unitree_gym,
    "unitree-gym-h1": unitree_gym_h1,
    "unitree-lab-g1": unitree_lab,
    "unitree-mjlab-2026-03": unitree_mjlab_2026,
}


def test_every_description_has_a_loop() -> None:
    """And none is of a robot that there is not."""
    assert sorted(LOOPS) == packaged("rivals") == sorted(KNOWN)
    assert {known.origin.robot for known in KNOWN.values()} <= set(packaged("robots"))


def asked(path: Path) -> Callable[[np.ndarray], np.ndarray]:
    """The network: an observation in 32 bits to an action."""
    if path.suffix == ".pt":
        module = torch.jit.load(str(path)).eval()
        return lambda seen: module(torch.from_numpy(seen[None])).detach().numpy()[0]
    session = onnx_session(path)
    name, *others = [each.name for each in session.get_inputs()]
    more = {each: np.zeros((1, 1), np.float32) for each in others}  # a clip's step: no action of it
    return lambda seen: session.run(None, {name: seen[None], **more})[0][0]


def played_apart(loop: Loop, path: Path, robot: Robot, data: Any) -> Iterator[np.ndarray]:
    """The actions of a maker's loop that begins in a state; PD at 500 Hz."""
    model, ask = robot.model, asked(path)
    places = np.array([model.joint(name).qposadr[0] for name in loop.joints])
    dofs = np.array([model.joint(name).dofadr[0] for name in loop.joints])
    motors = model.jnt_dofadr[model.actuator_trnid[:, 0]] - 6
    kp, kd, target = standing_gains(robot)
    kp[dofs - 6], kd[dofs - 6] = loop.kp, loop.kd
    target[dofs - 6] = loop.default if loop.held is None else loop.held
    moved = np.arange(len(dofs)) if loop.moved is None else np.array(loop.moved)
    action, default = np.zeros(len(moved)), np.asarray(loop.default, dtype=float)
    for step in range(STEPS):
        axes = np.zeros(9)
        mujoco.mju_quat2Mat(axes, data.qpos[3:7])
        R = axes.reshape(3, 3)
        roll_pitch = np.array([np.arctan2(R[2, 1], R[2, 2]), np.arcsin(-R[2, 0])])
        now = Now(data.qvel[3:6], -R[2], R.T @ data.qvel[:3], roll_pitch, data.qpos[places],
                  data.qvel[dofs], action, step, Rotation.from_matrix(R))  # fmt: skip
        action = np.asarray(ask(loop.observe(now).astype(np.float32)), dtype=float)
        yield action
        bounded = np.clip(action, -loop.bound, loop.bound)
        target[dofs[moved] - 6] = default[moved] + loop.scale * bounded
        if loop.adds is not None:
            target[dofs[moved] - 6] += loop.adds(roll_pitch, now.gyro)
        for _ in range(SUBSTEPS):
            data.ctrl[:] = (kp * (target - data.qpos[7:]) - kd * data.qvel[6:])[motors]
            mujoco.mj_step(model, data)


def standing_gains(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What holds all joints in the standing posture, critically damped at 15 rad/s."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    for column, unit in zip(M, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    inertia = np.diag(M)[6:]
    return 15.0**2 * inertia, 30.0 * inertia, robot.standing_qpos[7:].copy()


def first_actions(env: ResidualBalanceEnv, loop: Loop, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(T, na) the first actions in the environment and in the maker's loop, from a shaky start."""
    env.reset(seed=1, options=SHAKY)
    data, rest = mujoco.MjData(env.robot.model), np.zeros(len(env.action_names))
    data.qpos[:], data.qvel[:] = env.simulation.data.qpos, env.simulation.data.qvel
    here = []
    for _ in range(STEPS):
        env.step_without_info(rest)
        here.append(env.controller.action.copy())
    return np.array(here), np.array(list(played_apart(loop, path, env.robot, data)))


@pytest.mark.parametrize("name", LOOPS)
def test_it_acts_as_in_its_makers_loop(name: str) -> None:
    """Its first 200 actions, from a shaky start."""
    path = network(name)
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    robot = shared_robot(KNOWN[name].origin.robot)
    with allowed(path):
        env = ResidualBalanceEnv(robot, controller=name, pushes=None, duration=60.0)
    loop = LOOPS[name]()
    here, apart = first_actions(env, loop, path)
    size = np.maximum(1.0, np.abs(apart))
    apart_by = np.max(np.abs(here - apart) / size, axis=1)
    assert apart_by[:50].max() < 1e-5 and apart_by.max() < loop.grown and not env.fallen
