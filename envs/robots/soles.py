"""Soles: the flat polygon on which a foot stands, found from its collision geometry."""

from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from poise.configs.errors import ConfigError, shown

from .ground import can_touch

FLATNESS = 0.005  # [m] a point of the foot this close to the sole plane belongs to the sole
MAX_TILT = np.deg2rad(15.0)  # of a foot before levelling
SIDE_ANGLE = np.deg2rad(2.0)  # between facets that count as one side of a foot
MIN_SPAN = 0.01  # [m] a sole that is narrower than this cannot bear a moment
MAX_VERTICES = 8  # of a sole
RIM_POINTS = 16  # by which the rim of a cylinder is sampled


@dataclass(frozen=True)
class Sole:
    """A flat sole, fixed to a foot body. In the standing posture its x axis points to the robot's
    front, z up."""

    name: str  #: the foot's in the description
    body: str  #: name of the foot body
    body_id: int  #: its index
    geom_ids: tuple[int, ...]  #: the collision geoms that make the sole
    position: np.ndarray  #: (3,) reference point in the foot body's frame [m]: polygon's centroid
    rotation: np.ndarray  #: (3, 3) columns are the sole's axes in the foot body's frame
    polygon: np.ndarray  #: (k, 2) counter-clockwise vertices in the sole frame [m], 3 ≤ k ≤ 8

    def __post_init__(self) -> None:
        for array in (self.position, self.rotation, self.polygon):
            array.setflags(write=False)


def sole_pose(data: mujoco.MjData, sole: Sole) -> tuple[np.ndarray, np.ndarray]:
    """Point (3,) [m] and axes (3, 3) of a sole in the world, where `data` has its foot."""
    axes = data.xmat[sole.body_id].reshape(3, 3)
    return data.xpos[sole.body_id] + axes @ sole.position, axes @ sole.rotation


@dataclass(frozen=True)
class SolePlane:
    """The plane a foot rests on, in the foot body's frame."""

    normal: np.ndarray  #: (3,) unit vector into the foot
    points: np.ndarray  #: (n, 3) [m] of the foot in the plane, or near and projected on it; n ≥ 3


def sole_geoms(
    model: mujoco.MjModel, body_id: int, names: tuple[str, ...], ground: int
) -> tuple[int, ...]:
    """The geoms of a sole: those named, or all that are fixed to the foot and touch the ground.

    A name is that of a geom, or of a body fixed to the foot, for all of its geoms.

    Raises:
        ConfigError: a name is none of these, or nothing of the foot can touch the ground.
    """
    rigid = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] == body_id]
    solid = {model.geom(g).name or str(g): g for g in rigid if can_touch(model, g, ground)}
    named = {name: [geom] for name, geom in solid.items()}
    for geom in solid.values():
        body = model.body(model.geom_bodyid[geom]).name
        if body not in solid:
            named.setdefault(body, []).append(geom)
    for name in names:
        if name not in named:
            raise ConfigError(
                f"{shown(name)} is no geom of the foot that collides with the ground",
                field="geoms",
                choices=named,
            )
    if not solid:
        moving = model.body_weldid[body_id]
        other = f"; it is fixed to {model.body(moving).name!r}: name that one"
        advice = "" if moving == body_id else other
        raise ConfigError(
            f"the foot {model.body(body_id).name!r} has no collision geometry: none of its "
            f"{len(rigid)} geoms collides with the ground (contype, conaffinity, pairs){advice}"
        )
    return tuple(dict.fromkeys(geom for name in names or solid for geom in named[name]))


def find_sole_plane(
    model: mujoco.MjModel, data: mujoco.MjData, body_id: int, geom_ids: tuple[int, ...]
) -> SolePlane:
    """The plane on which the foot would rest, near the horizontal in the present posture.

    Raises:
        ConfigError: the foot has no flat side, or it is tilted by more than 15°.
    """
    world_down = down = -data.xmat[body_id].reshape(3, 3)[2]  # in the foot frame
    for _ in range(3):  # round geoms (spheres, capsules) move their lowest point with the direction
        points = np.vstack([_lowest_points(model, data, g, body_id, down) for g in geom_ids])
        side = _downward_normal(points, world_down)
        if side is None:
            break
        down = side
    points = np.vstack([_lowest_points(model, data, g, body_id, down) for g in geom_ids])
    depth = points @ down
    points = (points + np.outer(depth.max() - depth, down))[depth > depth.max() - FLATNESS]
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False) / np.sqrt(len(points))
    if side is None or len(points) < 3 or spread[1] < MIN_SPAN / 2:
        raise ConfigError(
            f"the foot {model.body(body_id).name!r} has no flat side of collision geometry within "
            f"{np.rad2deg(MAX_TILT):.0f}° of the ground in the standing posture"
        )
    return SolePlane(normal=-down, points=points)


def sole_frame(plane: SolePlane, xmat: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, rotation and polygon, as of a `Sole`, of a foot that rests on a plane.

    The robot faces along the world's x axis; `xmat` (9,) is the orientation of the foot body.
    """
    rotation = xmat.reshape(3, 3).T.copy()  # the world's axes in the foot frame
    points = plane.points @ rotation  # in the sole's axes, still about the foot body's origin
    polygon = simplify(points[ConvexHull(points[:, :2]).vertices, :2], MAX_VERTICES)
    centre = centroid(polygon)
    angles = np.arctan2(*(polygon - centre).T[::-1]) % (2 * np.pi)
    polygon = np.roll(polygon, -int(np.argmin(angles)), axis=0)  # starts at the front left
    position = rotation @ np.array([*centre, points[0, 2]])
    return position, rotation, polygon - centre


def centroid(polygon: np.ndarray) -> np.ndarray:
    """Centroid of the area of a polygon with vertices (k, 2)."""
    shifted = polygon - polygon[0]
    following = np.roll(shifted, -1, axis=0)
    cross = shifted[:, 0] * following[:, 1] - shifted[:, 1] * following[:, 0]
    return polygon[0] + cross @ (shifted + following) / (3.0 * cross.sum())


def simplify(polygon: np.ndarray, count: int) -> np.ndarray:
    """At most ``count`` of a convex polygon's vertices, dropping those that cost the least area.

    What is left lies inside the given polygon.
    """
    polygon = polygon.copy()
    while True:
        back, ahead = polygon - np.roll(polygon, 1, axis=0), np.roll(polygon, -1, axis=0) - polygon
        loss = back[:, 0] * ahead[:, 1] - back[:, 1] * ahead[:, 0]  # twice the triangle's area
        smallest = int(np.argmin(loss))
        if len(polygon) <= count and loss[smallest] > 1e-9:  # [m²] less: on a straight edge
            return polygon
        polygon = np.delete(polygon, smallest, axis=0)


def _lowest_points(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, body_id: int, down: np.ndarray
) -> np.ndarray:
    """(n, 3) points of the geom that can touch a plane whose downward normal is ``down``.

    In the frame of the foot body, as ``down`` is.
    """
    to_foot = data.xmat[body_id].reshape(3, 3).T
    axes = to_foot @ data.geom_xmat[geom].reshape(3, 3)
    origin = to_foot @ (data.geom_xpos[geom] - data.xpos[body_id])
    size, kind = model.geom_size[geom], mujoco.mjtGeom(int(model.geom_type[geom]))
    below = axes.T @ down  # in the geom's frame, as all that follows
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        local = size[0] * below[None]
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        ends = np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]])
        local = ends + size[0] * below
    elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        local = (size**2 * below / np.linalg.norm(size * below))[None]
    elif kind == mujoco.mjtGeom.mjGEOM_BOX:
        local = np.array(list(product((-1, 1), repeat=3))) * size
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        angles = np.arange(RIM_POINTS) * (2 * np.pi / RIM_POINTS)
        rim = size[0] * np.column_stack([np.cos(angles), np.sin(angles)])
        local = np.vstack(
            [np.column_stack([rim, np.full(RIM_POINTS, z)]) for z in (-size[1], size[1])]
        )
    elif kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first = model.mesh_vertadr[mesh]
        local = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
    else:
        raise ConfigError(f"a sole cannot be made of the geom type {kind.name}")
    return origin + local @ axes.T


def _downward_normal(points: np.ndarray, down: np.ndarray) -> np.ndarray | None:
    """Outward normal of the side of the points' hull that faces ``down``, or None without one.

    A side is a set of facets with the same normal, up to 2°. Of several (a flat sole, and the
    slant from there to a raised toe) the larger wins, and the more level.
    """
    above = points.mean(0) - np.ptp(points, axis=0).max() * down  # gives flat point sets a volume
    try:
        hull = ConvexHull(np.vstack([points, above]))
    except QhullError:  # all points on one line
        return None
    normals = hull.equations[:, :3]
    tilts = np.arccos(np.clip(normals @ down, -1.0, 1.0))
    near = tilts < MAX_TILT
    if not near.any():
        return None
    normals, tilts, facets = normals[near], tilts[near], hull.points[hull.simplices[near]]
    cross = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    areas = np.linalg.norm(cross, axis=1)
    same_side = normals @ normals.T > np.cos(SIDE_ANGLE)
    best = np.argmax((same_side @ areas) * (1.0 - tilts / MAX_TILT))
    mean = (same_side[best] * areas) @ normals
    return mean / np.linalg.norm(mean)
