"""A robot as few simple shapes that a page can draw: capsules, and boxes by their corners."""

from itertools import product
from typing import Any

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

SEEN = 3  # groups of geoms below this one are drawn, as in MuJoCo's own viewer
SPHERE, CAPSULE, CYLINDER, BOX, MESH, ELLIPSOID = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("SPHERE", "CAPSULE", "CYLINDER", "BOX", "MESH", "ELLIPSOID")
)


def shapes(robot: Robot) -> list[dict[str, Any]]:
    """Return the shapes of a robot, in the axes of their bodies [m], to the millimetre.

    Each has `body`, its number, and either `ends`, two points, with the radius `r`, or `corners`,
    eight points. A mesh is a capsule as long as its bounding box and as thick as its middle edge.
    """
    model, found = robot.model, []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        seen = model.geom_group[geom] < SEEN and model.geom_rgba[geom, 3] > 0.0
        if model.body_rootid[body] != model.body_rootid[robot.root_body_id] or not seen:
            continue
        if (shape := _shape(model, geom)) is not None:
            found.append({"body": body, **shape})
    return found


def _shape(model: mujoco.MjModel, geom: int) -> dict[str, Any] | None:
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == SPHERE:
        return _capsule(model, geom, np.zeros(3), np.zeros(3), float(size[0]))
    if kind in (CAPSULE, CYLINDER):
        end = np.array([0.0, 0.0, size[1]])
        return _capsule(model, geom, -end, end, float(size[0]))
    centre, half = np.split(model.geom_aabb[geom].astype(float), 2)
    if kind == BOX:
        corners = [
            _placed(model, geom, np.array(signs) * half) for signs in product((-1, 1), repeat=3)
        ]
        return {"corners": corners}
    if kind not in (MESH, ELLIPSOID):
        return None
    order = np.argsort(half)
    radius, along = float(half[order[1]]), np.zeros(3)
    along[order[2]] = max(half[order[2]] - radius, 0.0)
    return _capsule(model, geom, centre - along, centre + along, radius)


def _capsule(
    model: mujoco.MjModel, geom: int, first: np.ndarray, second: np.ndarray, radius: float
) -> dict[str, Any]:
    ends = [_placed(model, geom, first), _placed(model, geom, second)]
    return {"ends": ends, "r": round(radius, 3)}


def _placed(model: mujoco.MjModel, geom: int, point: np.ndarray) -> list[float]:
    """Return a point of a geom in the axes of its body."""
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, point, model.geom_quat[geom])
    return np.round(model.geom_pos[geom] + turned, 3).tolist()
