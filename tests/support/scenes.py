"""Scenes of a robot that moves smoothly, its soles wherever that takes them."""

from __future__ import annotations

import mujoco
import numpy as np

from poise.baselines.motion.retargeting.limbs import find_limbs
from poise.baselines.motion.space_time.constraints.scene import Scene
from tests.support.physics import robot_named

DT, LEAD = 1.0 / 30.0, 0.2


def swaying(name: str = "humanoid", frames: int = 25, size: float = 0.3) -> Scene:
    """A scene whose joints and root sway by `size` [rad, m] about standing."""
    robot, rng = robot_named(name), np.random.default_rng(5)
    times = np.arange(frames) * DT
    nv = robot.model.nv
    rates, phases = rng.uniform(2.0, 5.0, nv), rng.uniform(0.0, 6.0, nv)
    deltas = size * (np.sin(np.outer(times, rates) + phases) - np.sin(phases))
    qpos = np.tile(robot.standing_qpos, (frames, 1))
    for posture, delta in zip(qpos, deltas, strict=True):
        mujoco.mj_integratePos(robot.model, posture, delta, 1.0)
    planted = np.ones((frames, 2), dtype=bool)
    return Scene(robot, find_limbs(robot), qpos, DT, LEAD, planted)
