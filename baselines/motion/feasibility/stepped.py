"""A motion with steps as a trajectory of the whole robot, on the soles that are planted."""

import mujoco
import numpy as np

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.envs.compiled.maths.polygons import convex_hull, half_planes
from poise.envs.robots.robot import Robot

from .trajectory import PlantedRobot, Trajectory, record_robot

SMALL = 1e-3  # [s] of the differences that velocities and accelerations are


def sample_stepped(planted: PlantedRobot, motion: ReferenceMotion, times: np.ndarray) -> Trajectory:
    """The whole robot at `times` (n,) [s], in the motion's own frame.

    Velocities and accelerations are central differences.
    """
    robot, footing = planted.robot, motion.footing
    assert footing is not None
    model, nv, data = robot.model, robot.model.nv, mujoco.MjData(robot.model)
    ahead, back, turn = np.empty(nv), np.empty(nv), np.empty(4)

    def posture(time: float) -> np.ndarray:
        sample = footing.sample(time)
        angle = float(np.linalg.norm(sample.root[0]))
        mujoco.mju_axisAngle2Quat(turn, sample.root[0] / max(angle, 1e-12), angle)
        mujoco.mju_mulQuat(data.qpos[3:7], turn, robot.standing_qpos[3:7])
        data.qpos[7:] = motion.sample(time).q_ref
        data.qpos[:3] = 0.0
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        com = sample.com[0] + [0.0, 0.0, planted.ground]
        data.qpos[:3] = com - data.subtree_com[robot.root_body_id]
        return np.array(data.qpos)

    def put(time: float) -> np.ndarray:
        before, now, after = (posture(time + step) for step in (-SMALL, 0.0, SMALL))
        mujoco.mj_differentiatePos(model, back, SMALL, before, now)
        mujoco.mj_differentiatePos(model, ahead, SMALL, now, after)
        planted.put(now, 0.5 * (ahead + back))
        return (ahead - back) / SMALL

    down = np.array([footing.sample(time).planted for time in times])
    return record_robot(planted, times, put)._replace(planted=down)


def margins(robot: Robot, path: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """(n,) distance of the ZMP to the edge of the hull of the planted soles, above 0 inside [m];
    (n,) how far a corner of one has moved since it was planted [m]."""
    counts = [len(sole.polygon) for sole in robot.soles]
    owner = np.repeat(np.arange(len(counts)), counts)
    margin, drift = np.empty(len(path.times)), np.zeros(len(path.times))
    rest: list[np.ndarray | None] = [None] * len(counts)
    for k, down in enumerate(path.planted):
        points = path.corners[k, down[owner], :2].copy()
        hull = np.empty((2 * len(points) + 1, 2))
        normals, offsets = half_planes(hull[: convex_hull(points, len(points), 1e-6, hull)])
        margin[k] = (offsets - normals @ path.zmp[k]).min()
        for foot in range(len(counts)):
            own = path.corners[k, owner == foot]
            now = rest[foot]
            rest[foot] = None if not down[foot] else own if now is None else now
            if now is not None and down[foot]:
                drift[k] = max(drift[k], float(np.linalg.norm(own - now, axis=1).max()))
    return margin, drift
