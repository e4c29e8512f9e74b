"""The friction cone of a flat sole: the wrenches that it transmits without sliding or tipping."""

import numpy as np
from scipy.spatial import ConvexHull

from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot


def wrench_cone(polygon: np.ndarray, friction: float) -> np.ndarray:
    """Rows R (r, 6) of R w ≤ 0 for a wrench w = [f; n] at the sole's reference point, sole axes.

    Exactly the sums of forces at the vertices of `polygon` (k, 2) [m], each with
    |f_x| + |f_y| ≤ μ f_z, MuJoCo's own pyramid [Caron15]. So the nearer the centre of pressure
    (−n_y, n_x)/f_z is to the edge, the less yaw moment is left; at a corner there is none.
    The rows are the facets of the hull of the vertices' extreme wrenches with f_z = 1.
    """
    extremes = np.array(
        [
            [f_x, f_y, y, -x, x * f_y - y * f_x]
            for x, y in polygon
            for f_x, f_y in friction * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        ]
    )
    scale = np.abs(extremes).max(axis=0)
    facets = ConvexHull(extremes / scale).equations  # normal · point + offset ≤ 0
    facets[:, :5] /= scale
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    facets = facets[np.unique(facets.round(7), axis=0, return_index=True)[1]]  # Qhull triangulates
    return facets[:, [0, 1, 5, 2, 3, 4]]


def robot_cones(robot: Robot, friction_share: float, polygon_share: float) -> np.ndarray:
    """Cones (nc, r, 6) of all soles, with a fraction of the real friction and of the real polygon.

    Rows are padded with zeros, so that soles of any polygon have the same count.
    """
    model, ground = robot.model, robot.ground_geom_id
    cones = [
        wrench_cone(
            polygon_share * sole.polygon,
            friction_share * contact_friction(model, ground, sole.geom_ids),
        )
        for sole in robot.soles
    ]
    rows = max(len(cone) for cone in cones)
    return np.array([np.pad(cone, ((0, rows - len(cone)), (0, 0))) for cone in cones])
