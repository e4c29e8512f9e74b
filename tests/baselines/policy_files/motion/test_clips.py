"""baselines/policy_files/motion: clips of the usual exporters, frame by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.robot_clip import About, RobotClip, write_robot_clip
from poise.baselines.policy_files.clip_network import network_clip
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.motion.clips import read_clip, standing_clip
from poise.baselines.policy_files.networks import load_network
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.policies import within
from tests.support.refused import invalid
from tests.support.shared import robot

PERIOD, COUNT = 0.02, 11
BODY = robot("compact")
NAMES = list(BODY.joint_names)
N = len(NAMES)


def moving(rate: float) -> tuple[np.ndarray, Rotation, np.ndarray]:
    """Root, its attitude, and joints, COUNT of each: what lies between two is no straight line."""
    t = np.arange(COUNT)[:, None] / rate
    root = np.hstack([t, -t, 0.8 + 0.0 * t])
    turn = Rotation.from_euler("ZYX", np.hstack([3.0 * t, 0.4 * t, -0.3 * t]))
    return root, turn, np.sin(3.0 * t + np.arange(N)) * 0.2


def csv(path: Path, rate: float, header: str = "") -> Path:
    root, turn, q = moving(rate)
    np.savetxt(path, np.hstack([root, turn.as_quat(), q]), delimiter=",", header=header,
               comments="", fmt="%.17g")  # fmt: skip
    return path


def npz(path: Path, **changes: Any) -> Path:
    """As csv_to_npz of mjlab and Isaac Lab writes it, with a second body."""
    root, turn, q = moving(50.0)
    quat = turn.as_quat()[:, [3, 0, 1, 2]]
    arrays = {
        "fps": np.array([50]), "joint_pos": q.astype(np.float32),
        "joint_vel": np.gradient(q, PERIOD, axis=0).astype(np.float32),
        "body_pos_w": np.stack([root, root + 1.0], axis=1),
        "body_quat_w": np.stack([quat, quat[::-1]], axis=1),
    }  # fmt: skip
    arrays |= changes
    np.savez(path, **{name: values for name, values in arrays.items() if values is not None})
    return path


def check(clip: Any, joints: list[int] | None = None) -> None:
    root, turn, q = moving(50.0)
    places = list(range(N)) if joints is None else joints
    np.testing.assert_allclose(clip.qpos[:, :3], root, atol=1e-6)
    apart = turn.inv() * Rotation.from_quat(clip.qpos[:, [4, 5, 6, 3]])
    assert np.max(apart.magnitude()) < 1e-6
    np.testing.assert_allclose(clip.qpos[:, 7:][:, places], q, atol=1e-6)
    expected = np.gradient(q, PERIOD, axis=0)
    np.testing.assert_allclose(clip.velocities[:, places], expected, atol=1e-4)
    assert clip.duration == pytest.approx(0.2)


@pytest.mark.parametrize("header", ["", "x,y,z,qx,qy,qz,qw,joints"])
def test_a_table_of_lafan1(tmp_path: Path, header: str) -> None:
    """Quaternions xyzw; velocities are central differences."""
    check(read_clip(csv(tmp_path / "a.csv", 50.0, header), BODY, NAMES, PERIOD, 50.0))


def test_a_table_at_another_rate(tmp_path: Path) -> None:
    """30 Hz, unless it is said: between frames a line, and an arc of the attitude."""
    clip = read_clip(csv(tmp_path / "a.csv", 30.0), BODY, NAMES, PERIOD)
    _, turn, q = moving(30.0)
    assert len(clip.qpos) == 17  # 10 / 30 s at 50 Hz
    np.testing.assert_allclose(clip.qpos[1, 7:], 0.4 * q[0] + 0.6 * q[1], atol=1e-9)
    arc = turn[0] * Rotation.from_rotvec(0.6 * (turn[0].inv() * turn[1]).as_rotvec())
    found = Rotation.from_quat(clip.qpos[1, [4, 5, 6, 3]])
    assert (arc.inv() * found).magnitude() < 1e-9
    np.testing.assert_allclose(clip.qpos[15, 7:], q[9], atol=1e-9)  # 0.3 s is a frame of both


def test_arrays_of_mjlab_and_isaac_lab(tmp_path: Path) -> None:
    """Joints in the policy's order; the root is the first body, or the one of its name."""
    check(read_clip(npz(tmp_path / "a.npz"), BODY, NAMES, PERIOD))
    order = [*range(1, N), 0]
    clip = read_clip(tmp_path / "a.npz", BODY, [NAMES[i] for i in order], PERIOD)
    check(clip, order)
    root = BODY.model.body(BODY.root_body_id).name
    plain = np.load(npz(tmp_path / "b.npz"))
    swapped = {name: plain[name][:, ::-1] for name in ("body_pos_w", "body_quat_w")}
    check(read_clip(npz(tmp_path / "c.npz", **swapped, body_names=np.array(["world", root])),
                    BODY, NAMES, PERIOD))  # fmt: skip


def test_arrays_of_holosoma(tmp_path: Path) -> None:
    """The root before the joints, whose names the file has."""
    root, turn, q = moving(50.0)
    whole = np.hstack([root, turn.as_quat()[:, [3, 0, 1, 2]], q])
    v = np.hstack([np.ones((COUNT, 6)), np.gradient(q, PERIOD, axis=0)])
    path = npz(tmp_path / "a.npz", joint_pos=whole, joint_vel=v, joint_names=np.array(NAMES))
    check(read_clip(path, BODY, NAMES[::-1], PERIOD))


def test_a_clip_of_our_own(tmp_path: Path) -> None:
    """As poise motion import writes it, so that a BVH drives a tracker; of this robot alone."""
    root, turn, q = moving(50.0)
    qpos = np.hstack([root, turn.as_quat()[:, [3, 0, 1, 2]], q])
    clip = RobotClip(About("compact", BODY.fingerprint, "own"), 0.02, qpos)
    write_robot_clip(clip, tmp_path / "own.npz")
    check(read_clip(tmp_path / "own.npz", BODY, NAMES[::-1], PERIOD))
    with invalid("motion", "'compact'"):
        read_clip(tmp_path / "own.npz", robot(), list(robot().joint_names), PERIOD)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"joint_vel": None}, "lacks joint_vel: a clip holds joint_pos"),
        ({"fps": np.array([0])}, "fps: must be from 1 to 1000 Hz, not 0"),
        ({"joint_pos": np.zeros((COUNT, 3)), "joint_vel": np.zeros((COUNT, 3))},
         f"joint_pos: has 3 joints, the policy {N}"),
        ({"joint_pos": np.zeros((4, N))}, "have other numbers of frames"),
        ({"joint_vel": np.full((COUNT, N), np.nan)}, "not finite, or beyond 10000"),
        ({"body_quat_w": np.zeros((COUNT, 2, 4))}, "quaternion of frame 0 has no norm of 1"),
    ],
)  # fmt: skip
def test_what_is_no_clip(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    """One line with the file, and what is wrong with it."""
    with pytest.raises(ConfigError, match=message) as error:
        read_clip(npz(tmp_path / "a.npz", **changes), BODY, NAMES, PERIOD)
    assert str(error.value).startswith(str(tmp_path / "a.npz"))


def test_tables_that_are_none(tmp_path: Path) -> None:
    """Columns of another robot, words, nothing, another kind of file."""
    path = tmp_path / "a.csv"
    for text, message in (("1,2,3\n", f"has 3 columns; 'compact' has {7 + N}"),
                          ("x\n1,2\n3\n", "cannot be read"), ("", "has other columns"),
                          ("1,a\n1,b\n", "cannot be read")):  # fmt: skip
        path.write_text(text)
        with pytest.raises(ConfigError, match=message):
            read_clip(path, BODY, NAMES, PERIOD)
    with pytest.raises(ConfigError, match="is no clip of a robot .choices"):
        read_clip(tmp_path / "a.bvh", BODY, NAMES, PERIOD)


def test_what_stands_is_as_high_as_standing() -> None:
    """Whatever its knees do, its lowest sole is on the ground."""
    qpos = BODY.standing_qpos.copy()
    qpos[7:] += 0.1 * np.array([name.endswith(("knee", "hip_pitch")) for name in NAMES])
    clip = standing_clip(BODY, PERIOD, qpos)
    heights = []
    for posture in (BODY.standing_qpos, clip.qpos[0]):
        state = Simulation(BODY).reset(posture, np.zeros(BODY.model.nv))
        heights.append(state.sole_points[:, 2].min())
    assert heights[0] == pytest.approx(heights[1], abs=1e-9)
    assert abs(clip.qpos[0, 2] - BODY.standing_qpos[2]) > 1e-4


CONFIG: dict[str, Any] = {"obs": ({"term": "constant"},), "time_step": ({"term": "time_step"},)}


@pytest.mark.parametrize("anchor", [False, True])
def test_a_clip_within_a_network(tmp_path: Path, anchor: bool) -> None:
    """By its bodies, of which the root is the first, or by its anchor; as long as it changes."""
    root, turn, q = moving(50.0)
    v = np.gradient(q, PERIOD, axis=0)
    given = {"joint_pos": q, "joint_vel": v}
    name = "waist_yaw_link" if "waist_yaw_link" in bodies() else bodies()[3]
    if anchor:
        poses = [pose(np.concatenate([r, t, j]), name) for r, t, j in zip(
            root, turn.as_quat()[:, [3, 0, 1, 2]], q, strict=True)]  # fmt: skip
        given["ref_pos_xyz"] = np.array([place for place, _ in poses])
        given["ref_quat_xyzw"] = np.array([each.as_quat() for _, each in poses])
    else:
        quat = turn.as_quat()[:, [3, 0, 1, 2]]
        given["body_pos_w"] = np.stack([root, root + 1.0], axis=1)
        given["body_quat_w"] = np.stack([quat, quat[::-1]], axis=1)
    path = within(tmp_path / "p.onnx", 4, **given)
    network = load_network(path, PolicyFileConfig(observations=CONFIG))
    check(network_clip(network, BODY, NAMES, name, PERIOD, "own.yaml"))


def test_a_network_without_a_clip(tmp_path: Path) -> None:
    """The field, and what to do."""
    path = within(tmp_path / "p.onnx", 4, joint_pos=moving(50.0)[2])
    network = load_network(path, PolicyFileConfig(observations=CONFIG))
    with invalid("motion.clip"):
        network_clip(network, BODY, NAMES, "", PERIOD, "own.yaml")


def bodies() -> list[str]:
    return [BODY.model.body(i).name for i in range(BODY.model.nbody)]


def pose(qpos: np.ndarray, name: str) -> tuple[np.ndarray, Rotation]:
    """Where the body of a name is, by MuJoCo."""
    data = Simulation(BODY)
    data.reset(qpos, np.zeros(BODY.model.nv))
    body = BODY.model.body(name).id
    return (data.data.xpos[body].copy(),
            Rotation.from_matrix(data.data.xmat[body].reshape(3, 3)))  # fmt: skip
