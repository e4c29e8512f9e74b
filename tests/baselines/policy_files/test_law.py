"""baselines/policy_files/joints.py: what a law adds to the targets of joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.joints import JointServos, joint_servos
from poise.baselines.registry import load_controller
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.mirror import mirror_robot
from poise.envs.robots.robot import Robot
from tests.support.policies import linear, write_onnx, write_yaml
from tests.support.shared import robot as shared_robot

LAW = {
    "*hip_pitch": {
        "action": 0.8,
        "pitch": 0.3,
        "pitch_rate": 0.04,
        "roll": -0.2,
        "roll_rate": 0.05,
    },
    "*hip_roll": {"stiffness": 1.5, "damping": 0.5, "roll": 0.4, "roll_rate": -0.03, "pitch": 0.1},
}
ATTITUDE = np.array([0.2, -0.7, 0.1, 0.9])  # θ, ω_y, φ, ω_x


@pytest.fixture(scope="module")
def robot() -> Robot:
    return shared_robot("compact")


def fields(robot: Robot, **more: Any) -> dict[str, Any]:
    """A policy that moves all joints."""
    return {
        "kind": "policy-file",
        "policy": "policy.onnx",
        "joints": list(robot.joint_names),
        "default": [float(q) for q in robot.standing_qpos[7:]],
        "stiffness": 100.0,
        "damping": 2.0,
        "action_scale": 0.05,
        "observations": [{"term": "projected_gravity"}],
        **more,
    }


def servos(robot: Robot, **more: Any) -> JointServos:
    return joint_servos(robot, build(PolicyFileConfig, fields(robot, **more), "own.yaml"))


def test_a_mirrored_attitude_moves_the_other_side(robot: Robot) -> None:
    """Exchanging left and right before or after the law is the same."""
    mirror, image = mirror_robot(robot)["joints"], np.array([1.0, 1.0, -1.0, -1.0])
    obeying = servos(robot, law=LAW)
    n = len(robot.joint_names)
    change = obeying.targets(np.zeros(n), ATTITUDE) - obeying.offset
    mirrored = obeying.targets(np.zeros(n), image * ATTITUDE) - obeying.offset
    assert np.count_nonzero(change) == 4
    np.testing.assert_allclose(mirror(change), mirrored, atol=1e-15)


def test_torques_are_those_of_the_equation(robot: Robot, tmp_path: Path) -> None:
    """τ = k K (q* − q) − d D q̇ with q* of the law, in a state that leans, turns and moves."""
    n = len(robot.joint_names)
    W = linear(3, n, 1.0)
    write_onnx(tmp_path / "policy.onnx", W)
    write_yaml(tmp_path / "own.yaml", **fields(robot, law=LAW))
    simulation = Simulation(robot)
    qpos, rng = robot.standing_qpos.copy(), np.random.default_rng(3)
    yaw, pitch, roll = 0.4, 0.11, -0.07
    qpos[3:7] = _quaternion(yaw, pitch, roll)
    qvel = np.concatenate([rng.normal(0.0, 0.1, 3), [0.6, -0.5, 0.2], rng.normal(0.0, 0.2, n)])
    simulation.reset(qpos, qvel)
    controller = load_controller(tmp_path / "own.yaml", robot)
    controller.reset(simulation.state)
    torques = controller.torques(simulation.state, None)

    down = np.array([np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)])
    action = np.tanh(down @ W)
    left = {name: "left" in name for name in robot.joint_names}
    motors = list(controller.arrays.motor_dofs - 6)
    for i, name in enumerate(robot.joint_names):
        law = next((LAW[key] for key in LAW if key.strip("*") in name), {})
        ahead = law.get("pitch", 0.0) * pitch + law.get("pitch_rate", 0.0) * qvel[4]
        aside = law.get("roll", 0.0) * roll + law.get("roll_rate", 0.0) * qvel[3]
        # on the right a pitch turns as on the left, a roll the other way round
        same = 1.0 if left[name] or "hip_pitch" in name else -1.0
        target = robot.standing_qpos[7 + i] + 0.05 * law.get("action", 1.0) * action[i]
        target += same * (ahead + (aside if left[name] else -aside))
        tau = 100.0 * law.get("stiffness", 1.0) * (target - qpos[7 + i])
        tau -= 2.0 * law.get("damping", 1.0) * qvel[6 + i]
        limit = controller.arrays.torque_limit[motors.index(i)]
        assert abs(tau) < limit  # so that nothing hides behind a motor's limit
        assert torques[motors.index(i)] == pytest.approx(tau, abs=1e-5), name


def _quaternion(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """Of R_z(yaw) R_y(pitch) R_x(roll), w first."""
    turned = np.array([1.0, 0.0, 0.0, 0.0])
    for angle, axis in ((yaw, [0, 0, 1.0]), (pitch, [0, 1.0, 0]), (roll, [1.0, 0, 0])):
        one, both = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(one, np.array(axis), angle)
        mujoco.mju_mulQuat(both, turned, one)
        turned = both
    return turned


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ({"tail": {"pitch": 0.1}}, ["law", "tail", "choices"]),
        ({"*hip_pitch": {"lean": 0.1}}, ["law", "lean", "pitch"]),
        ({"*hip_pitch": {"action": 0.0}}, ["law", "action"]),
        ({"*hip_pitch": {"pitch": "much"}}, ["law", "pitch", "much"]),
        ({"*hip_pitch": 0.5}, ["law", "0.5"]),
    ],
)
def test_bad_laws_are_one_line(
    robot: Robot, tmp_path: Path, law: dict[str, Any], words: list[str]
) -> None:
    write_onnx(tmp_path / "policy.onnx", linear(3, len(robot.joint_names), 1.0))
    path = write_yaml(tmp_path / "own.yaml", **fields(robot, law=law))
    with pytest.raises(ConfigError) as caught:
        load_controller(path, robot)
    told = str(caught.value)
    assert str(path) in told and "\n" not in told.strip()
    assert all(word in told for word in words), told
