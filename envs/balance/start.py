"""The start of an episode: a disturbed standing posture."""

from dataclasses import dataclass, field

import numpy as np

from poise.envs.physics.simulation import Simulation


@dataclass(frozen=True)
class StartNoise:
    """The range in which a reset departs from the standing posture; uniform in ±."""

    joints: float = field(default=0.02, metadata={"min": 0.0, "max": 0.5})  # [rad]
    joint_speeds: float = field(default=0.05, metadata={"min": 0.0})  # [rad/s]
    speed: float = field(default=0.02, metadata={"min": 0.0})  # root, horizontal [m/s]


def disturbed_start(
    simulation: Simulation, noise: StartNoise, scale: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """A standing posture (nq,) with its lowest sole on the ground, and its velocity (nv,).

    Both are disturbed by `scale` times `noise`. The simulation is reset to find the lowest sole.
    """
    robot = simulation.robot
    qpos, qvel = robot.standing_qpos.copy(), np.zeros(robot.model.nv)
    nj = len(robot.joint_names)
    qpos[7:] += scale * rng.uniform(-noise.joints, noise.joints, nj)
    qpos[7:] = np.clip(qpos[7:], robot.joint_range[:, 0], robot.joint_range[:, 1])
    qvel[6:] = scale * rng.uniform(-noise.joint_speeds, noise.joint_speeds, nj)
    qvel[:2] = scale * rng.uniform(-noise.speed, noise.speed, 2)
    state = simulation.reset(qpos)
    lowest = min(
        float((point + polygon @ axes[:, :2].T)[:, 2].min())
        for point, axes, polygon in zip(
            state.sole_points, state.sole_axes, (s.polygon for s in robot.soles), strict=True
        )
    )
    qpos[2] -= lowest
    return qpos, qvel
