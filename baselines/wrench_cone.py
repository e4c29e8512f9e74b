"""The cone of wrenches that a flat sole can transmit without sliding or tipping."""

import mujoco
import numpy as np

from poise.envs.robot import Robot, Sole


def wrench_cone(polygon: np.ndarray, friction: float, yaw_radius: float) -> np.ndarray:
    """Rows R (r, 6) of R w ≤ 0 for a wrench w = [f; n] at the sole's reference point, sole axes.

    Friction |f_x| + |f_y| ≤ μ f_z, MuJoCo's own pyramid, inside the round cone in any orientation;
    yaw moment |n_z| ≤ μ ρ f_z with the radius ρ = `yaw_radius` [m]; centre of pressure
    (−n_y, n_x)/f_z inside `polygon` (k, 2), counter-clockwise [m]. Together they imply f_z ≥ 0.
    [Macchietto09]
    """
    rows = [
        [1, 1, -friction, 0, 0, 0],
        [1, -1, -friction, 0, 0, 0],
        [-1, 1, -friction, 0, 0, 0],
        [-1, -1, -friction, 0, 0, 0],
        [0, 0, -friction * yaw_radius, 0, 0, 1],
        [0, 0, -friction * yaw_radius, 0, 0, -1],
    ]
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        edge = (b - a) / np.linalg.norm(b - a)
        outward = np.array([edge[1], -edge[0]])
        # outward · (p − a) ≤ 0 with p f_z = (−n_y, n_x)
        rows.append([0, 0, -outward @ a, outward[1], -outward[0], 0])
    return np.array(rows, dtype=float)


def sole_friction(robot: Robot, sole: Sole) -> float:
    """Sliding friction of a sole on the ground, as MuJoCo combines it; the least of its geoms.

    An explicit contact pair has its own; else the geom of higher priority decides, or the larger
    of the two.
    """
    return min(_pair_friction(robot.model, geom, robot.ground_geom_id) for geom in sole.geom_ids)


def _pair_friction(model: mujoco.MjModel, geom: int, ground: int) -> float:
    for i in range(model.npair):
        if {int(model.pair_geom1[i]), int(model.pair_geom2[i])} == {geom, ground}:
            return float(model.pair_friction[i, 0])
    friction, priority = model.geom_friction[:, 0], model.geom_priority
    if priority[geom] != priority[ground]:
        return float(friction[geom if priority[geom] > priority[ground] else ground])
    return float(max(friction[geom], friction[ground]))


def robot_cones(robot: Robot, friction_share: float, polygon_share: float) -> np.ndarray:
    """Cones (nc, r, 6) of all soles, with a share of the real friction and of the real polygon."""
    cones = []
    for sole in robot.soles:
        polygon = polygon_share * sole.polygon
        radius = 0.5 * float(np.mean(np.linalg.norm(polygon, axis=1)))
        cones.append(wrench_cone(polygon, friction_share * sole_friction(robot, sole), radius))
    rows = max(len(cone) for cone in cones)
    return np.array([np.pad(cone, ((0, rows - len(cone)), (0, 0))) for cone in cones])
