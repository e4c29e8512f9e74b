"""The contact geometry of a robot for an engine that is not MuJoCo: points that the ground bears,
and shapes that touch each other.

A convex body touches a plane first at one of its extreme points, so corners, ends and rims stand
for it there. The robot's own bodies touch by their shapes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from poise.envs.robots.ground import can_touch, contact_friction
from poise.envs.robots.robot import Robot

GEOM = mujoco.mjtGeom
RIM_POINTS = 8  # for which the rim of a cylinder stands
MESH_POINTS = 8  # for which a mesh stands, but for those of a sole
#: shapes of which points hold only roughly the sole
ROUGHLY = (GEOM.mjGEOM_MESH, GEOM.mjGEOM_CYLINDER)
SHAPES = (GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_CAPSULE, GEOM.mjGEOM_BOX, GEOM.mjGEOM_CYLINDER,
          GEOM.mjGEOM_ELLIPSOID, GEOM.mjGEOM_MESH)  # fmt: skip


@dataclass(frozen=True)
class GroundPoints:
    """Points (n, 3) of a geom in its body's frame [m], each the middle of a ball."""

    geom: int
    points: np.ndarray
    radius: float  #: of the balls [m]; 0: corners
    friction: float  #: with the ground


def ground_points(robot: Robot) -> Iterator[GroundPoints]:
    """The points of every geom that can touch the ground."""
    model, ground = robot.model, robot.ground_geom_id
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if model.body_weldid[body] == 0 or not can_touch(model, geom, ground):
            continue
        local, radius = _extremes(model, geom)
        points = model.geom_pos[geom] + local @ rotation_of(model.geom_quat[geom]).T
        for sole in robot.soles:  # that its corners are among them
            if geom in sole.geom_ids and GEOM(int(model.geom_type[geom])) in ROUGHLY:
                flat = np.column_stack([sole.polygon, np.zeros(len(sole.polygon))])
                corners = sole.position + flat @ sole.rotation.T
                points = np.vstack([points, _moved(model, sole.body_id, body, corners)])
        yield GroundPoints(geom, points, radius, contact_friction(model, ground, [geom]))


def touching_pairs(robot: Robot) -> list[tuple[int, int]]:
    """Pairs of the robot's geoms that may touch each other, as MuJoCo has it: not of bodies that
    are fixed to each other, of parent and child, or excluded."""
    model = robot.model
    weld = model.body_weldid
    bodies = [int(weld[model.geom_bodyid[geom]]) for geom in range(model.ngeom)]
    excluded = set(model.exclude_signature.tolist())
    listed = {(min(p), max(p)) for p in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(),
                                            strict=True)}  # fmt: skip
    related = not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    moving = [
        g for g in range(model.ngeom) if bodies[g] != 0 and GEOM(int(model.geom_type[g])) in SHAPES
    ]
    found = []
    for a, b in combinations(moving, 2):
        if (a, b) not in listed:
            one, other = bodies[a], bodies[b]
            parents = int(weld[model.body_parentid[one]]), int(weld[model.body_parentid[other]])
            kin = related and (parents[0] == other or parents[1] == one)
            if one == other or kin or not can_touch(model, a, b):
                continue
            own = int(model.geom_bodyid[a]), int(model.geom_bodyid[b])
            if excluded & {(own[0] << 16) + own[1], (own[1] << 16) + own[0]}:
                continue
        found.append((a, b))
    return found


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) of a quaternion w x y z."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, np.asarray(quaternion, dtype=float))
    return axes.reshape(3, 3)


def mesh_vertices(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """(n, 3) vertices of the convex hull of a geom's mesh, in its frame [m]."""
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    vertices = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
    return vertices[ConvexHull(vertices).vertices]


def _moved(model: mujoco.MjModel, source: int, target: int, points: np.ndarray) -> np.ndarray:
    """Points in the frame of a body that is fixed to another one, in whose frame they are."""
    if source == target:
        return points
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    world = data.xpos[source] + points @ data.xmat[source].reshape(3, 3).T
    moved: np.ndarray = (world - data.xpos[target]) @ data.xmat[target].reshape(3, 3)
    return moved


def _extremes(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, float]:
    """Middles (n, 3) in the geom's frame [m] and radius [m] of the balls that stand for it."""
    size, kind = model.geom_size[geom], GEOM(int(model.geom_type[geom]))
    if kind == GEOM.mjGEOM_SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == GEOM.mjGEOM_CAPSULE:
        return np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]]), float(size[0])
    if kind == GEOM.mjGEOM_BOX:
        return np.array(list(product((-1.0, 1.0), repeat=3))) * size, 0.0
    if kind == GEOM.mjGEOM_CYLINDER:
        angles = np.arange(RIM_POINTS) * (2.0 * np.pi / RIM_POINTS)
        rim = size[0] * np.column_stack([np.cos(angles), np.sin(angles)])
        ends = [np.column_stack([rim, np.full(RIM_POINTS, z)]) for z in (-size[1], size[1])]
        return np.vstack(ends), 0.0
    if kind == GEOM.mjGEOM_ELLIPSOID:
        directions = _sphere(MESH_POINTS)
        scaled = size**2 * directions
        return scaled / np.linalg.norm(size * directions, axis=1)[:, None], 0.0
    return _apart(mesh_vertices(model, geom), MESH_POINTS), 0.0


def _sphere(count: int) -> np.ndarray:
    """Directions (n, 3), evenly spread (Fibonacci), and the axes."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - z * z)
    spread = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), z])
    return np.vstack([spread, np.eye(3), -np.eye(3)])


def _apart(points: np.ndarray, count: int) -> np.ndarray:
    """`count` of the points at most, each as far as can be from those before."""
    chosen = [int(np.argmax(np.linalg.norm(points - points.mean(0), axis=1)))]
    away = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < min(count, len(points)):
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return points[chosen]
