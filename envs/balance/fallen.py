"""Postures on the ground, from which a robot has to get up."""

from functools import lru_cache

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

DROP = 0.3  # [m] above the standing CoM height, from which the robot falls
SPREAD = 0.5  # of each joint's range around the standing posture
SETTLE = 2.0  # [s]
DAMPING = 0.1  # [s/rad] of the motors while it falls, over their limits
UNLIMITED = 1.0  # [rad] a joint without limits goes from standing


def fallen_posture(robot: Robot, number: int) -> np.ndarray:
    """A posture (nq,) at rest on the ground; the same `number` gives the same bits.

    The robot is dropped in an orientation that is uniform over all rotations, its joints anywhere
    in half of their ranges, with motors that only damp, τ = −D q̇ within ± τ_max; what has come
    of it after 2 s is the posture.
    """
    return _settled(robot.fingerprint, number, _Shared(robot)).copy()


class _Shared:
    """A robot beside the key of the cache: its fingerprint stands for it."""

    def __init__(self, robot: Robot):
        self.robot = robot

    def __hash__(self) -> int:
        return 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shared)


@lru_cache(maxsize=4096)
def _settled(fingerprint: str, number: int, shared: _Shared) -> np.ndarray:
    robot = shared.robot
    model, data = robot.model, mujoco.MjData(robot.model)
    rng = np.random.default_rng(np.random.SeedSequence([number, 5]))
    low, high = robot.joint_range.T
    standing = robot.standing_qpos[7:]
    low = np.where(np.isfinite(low), low, standing - UNLIMITED)
    high = np.where(np.isfinite(high), high, standing + UNLIMITED)
    quaternion = rng.normal(size=4)
    data.qpos[:] = robot.standing_qpos
    data.qpos[2] += DROP
    data.qpos[3:7] = quaternion / np.linalg.norm(quaternion)
    data.qpos[7:] = np.clip(standing + SPREAD * (rng.uniform(low, high) - standing), low, high)
    damping = DAMPING * robot.torque_limit
    for _ in range(round(SETTLE / model.opt.timestep)):
        speed = data.qvel[robot.motor_dofs]
        data.ctrl[:] = np.clip(-damping * speed, -robot.torque_limit, robot.torque_limit)
        mujoco.mj_step(model, data)
    return data.qpos.copy()
