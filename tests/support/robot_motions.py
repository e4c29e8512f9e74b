"""A short motion of the default humanoid as a file, as `poise motion import` writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from poise.baselines.balance.references.robot_clip import About, RobotClip, write_robot_clip
from tests.support.physics import robot_named


def raised_arm(path: Path, angle: float = 0.5, seconds: float = 0.4) -> Path:
    """The humanoid raises its left forearm by an angle [rad] and lowers it again."""
    robot = robot_named("humanoid")
    times = np.linspace(0.0, 1.0, 9)
    qpos = np.repeat(robot.standing_qpos[None, :], len(times), axis=0)
    elbow = 7 + next(i for i, name in enumerate(robot.joint_names) if "left_elbow" in name)
    low, high = robot.joint_range[elbow - 7]
    way = angle if qpos[0, elbow] + angle < high else -angle
    assert low < qpos[0, elbow] + way < high
    qpos[:, elbow] += way * np.sin(np.pi * times) ** 2
    about = About(robot.name, robot.fingerprint, path.stem)
    write_robot_clip(RobotClip(about, seconds / 8.0, qpos), path)
    return path
