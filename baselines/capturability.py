"""Where a linear inverted pendulum can be stopped: capture regions and CoP reach [Koolen12]."""

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from poise.envs.robot import Robot

from .support import nearest_inside

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of the load, at which the reach of two soles is sampled


def drifted(xi: np.ndarray, p: np.ndarray, omega: float, t: float) -> np.ndarray:
    """ξ(t) = p + (ξ − p) e^(ωt): where the capture point gets while the CoP stays at p."""
    return p + (xi - p) * np.exp(omega * t)


def capture_distance(steps: int, reach: float, length: float, omega: float, time: float) -> float:
    """d_N = r + l a (1 − a^N)/(1 − a), a = e^(−ω T_s): how far the capture point may be from the
    stance foot to come to rest in N steps of length l and time T_s [Koolen12]."""
    a = np.exp(-omega * time)
    return float(reach + length * a * (1.0 - a**steps) / (1.0 - a))


def outside(polygon: np.ndarray, point: np.ndarray) -> float:
    """Distance [m] of a point from a convex counter-clockwise polygon (k, 2); < 0 inside it."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    length = np.maximum(np.linalg.norm(edges, axis=1), 1e-12)
    beyond = (edges[:, 1] * (point - polygon)[:, 0] - edges[:, 0] * (point - polygon)[:, 1]) / length
    if np.all(beyond <= 0.0):
        return float(beyond.max())
    return float(np.linalg.norm(point - nearest_inside(polygon, point)))


def clipped(polygon: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """The part of a convex polygon (k, 2) with normal · p ≤ offset; at least its nearest point."""
    over = polygon @ normal - offset
    if np.all(over <= 0.0):
        return polygon
    if np.all(over > 0.0):
        return polygon[[int(np.argmin(over))]]
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if over[i] <= 0.0:
            kept.append(polygon[i])
        if (over[i] <= 0.0) != (over[j] <= 0.0):
            share = over[i] / (over[i] - over[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept)


def ankle_limits(robot: Robot, sole: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """N (k, 2), o (k,), b (k,): |N p − o| ≤ b/λ for a CoP p [m, sole frame] under a load of λ m g.

    One row for each motor joint of the foot itself: the moment of a vertical force about its axis
    in the standing posture, over its torque limit.
    """
    model, foot = robot.model, robot.soles[sole]
    data = mujoco.MjData(model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    body = foot.body_id
    R = data.xmat[body].reshape(3, 3) @ foot.rotation
    point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ foot.position
    weight = robot.mass * -model.opt.gravity[2]
    normals, offsets, bounds = [], [], []
    for joint in range(model.njnt):
        dof = model.jnt_dofadr[joint]
        motor = np.flatnonzero(np.asarray(robot.motor_dofs) == dof)
        if model.jnt_bodyid[joint] != body or len(motor) == 0:
            continue
        axis, anchor = data.xaxis[joint], data.xanchor[joint]
        # (axis × (point + R p − anchor))_z, affine in p
        offsets.append(-np.cross(axis, point - anchor)[2])
        normals.append([np.cross(axis, R[:, a])[2] for a in range(2)])
        bounds.append(robot.torque_limit[motor[0]] / weight)
    return np.reshape(normals, (-1, 2)), np.array(offsets), np.array(bounds)


class Reach:
    """Where soles can put the centre of pressure, with the torques that their ankles have."""

    def __init__(self, robot: Robot, share: float = 0.95):
        self.polygons = [share * sole.polygon for sole in robot.soles]
        self.limits = [ankle_limits(robot, i) for i in range(len(robot.soles))]
        self._local = {
            (i, load): self._one(i, load, share)
            for i in range(len(robot.soles))
            for load in SHARES
            if load > 0.0
        }

    def _one(self, sole: int, load: float, share: float) -> np.ndarray:
        polygon = self.polygons[sole]
        for normal, offset, bound in zip(*self.limits[sole], strict=True):
            room = share * bound / load
            polygon = clipped(polygon, normal, offset + room)
            polygon = clipped(polygon, -normal, room - offset)
        return polygon

    def placed(self, sole: int, point: np.ndarray, yaw: float, load: float = 1.0) -> np.ndarray:
        """(k, 2) the polygon of one sole at `point`, turned by `yaw`, under `load` m g [m]."""
        c, s = np.cos(yaw), np.sin(yaw)
        return np.asarray(point)[:2] + self._local[sole, load] @ np.array([[c, s], [-s, c]])

    def both(self, points: np.ndarray, yaws: np.ndarray) -> np.ndarray:
        """(k, 2) hull of what two soles reach together, over all ways to share the load."""
        corners = []
        for load in SHARES:
            if load in (0.0, 1.0):
                i = 0 if load == 1.0 else 1
                corners.append(self.placed(i, points[i], yaws[i]))
                continue
            first = load * self.placed(0, points[0], yaws[0], load)
            second = (1.0 - load) * self.placed(1, points[1], yaws[1], 1.0 - load)
            corners.append((first[:, None] + second[None]).reshape(-1, 2))
        cloud = np.vstack(corners)
        return cloud[ConvexHull(cloud).vertices]
