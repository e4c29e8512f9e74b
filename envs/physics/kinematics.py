"""All kinematic and centroidal quantities of one tick, computed once by compiled code.

Everything follows from what MuJoCo's position and velocity stages leave in `mjData`; no second
pass is made. Momentum comes from the six root rows of the dynamics: a free joint's rows hold
the wrench about the root's origin, so moving it to the CoM gives the centroidal momentum
matrix [Orin08] and its bias without building either.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.pendulum import compiled_rate
from poise.envs.compiled.maths.polygons import convex_hull
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.memory import GAP, guarded_zeros
from poise.envs.compiled.mutable import Mutable
from poise.envs.robots.ground import SLOTS
from poise.envs.robots.soles import MAX_VERTICES
from poise.envs.terrain.arrays import ground_height, surface_below, surface_height

from .arrays import RobotArrays, SimViews
from .jacobian import point_jacobian

STEEP = 0.7  # of the vertical part of a contact's direction, below which it is that of a wall
EDGE = 0.005  # [m] between surfaces from which their border is an edge


@dataclass(eq=False)
class StateArrays(Block):
    """Storage of one robot state; see `RobotState` for the meaning of each name."""

    qpos: Annotated[np.ndarray, "nv+1"]
    qvel: Annotated[np.ndarray, "nv"]
    M: Annotated[np.ndarray, "nv", "nv"]
    h: Annotated[np.ndarray, "nv"]
    root_axes: Annotated[np.ndarray, 3, 3]
    com: Annotated[np.ndarray, 3]
    com_vel: Annotated[np.ndarray, 3]
    momentum: Annotated[np.ndarray, 6]
    A: Annotated[np.ndarray, 6, "nv"]
    A_bias: Annotated[np.ndarray, 6]
    load: Annotated[np.ndarray, 3]  # estimated sustained load: f_z, and n_x, n_y about the CoM
    friction: Mutable[float]  # estimated, of the ground, over the model's
    J: Annotated[np.ndarray, "6nc", "nv"]
    Jdot_v: Annotated[np.ndarray, "6nc"]
    J_v: Annotated[np.ndarray, "6nc"]
    sole_point: Annotated[np.ndarray, "nc", 3]
    sole_axes: Annotated[np.ndarray, "nc", 3, 3]
    origin: Annotated[np.ndarray, 3]
    heading: Annotated[np.ndarray, 2]
    contact_wrench: Annotated[np.ndarray, 6]
    cop: Annotated[np.ndarray, 2]
    capture_point: Annotated[np.ndarray, 2]
    omega: Mutable[float]
    contacts: Annotated[np.ndarray, "nc"]
    other_contacts: Mutable[float]
    support: Annotated[np.ndarray, "corners", 2]
    support_size: Mutable[int]
    body_position: Annotated[np.ndarray, "nb", 3]
    body_axes: Annotated[np.ndarray, "nb", 3, 3]
    dof_axes: Annotated[np.ndarray, "nv", 6]
    dof_axes_dot: Annotated[np.ndarray, "nv", 6]
    tree_com: Annotated[np.ndarray, 3]
    ground: Annotated[np.ndarray, "nc"]
    edges: Annotated[np.ndarray, "nc"]
    motor_q: np.ndarray  # (nv − 6,) joint positions and velocities as the motors read them now:
    motor_dq: np.ndarray  # (nv − 6,) those of qpos and qvel, or what encoders give


def allocate_state(nv: int, nc: int, nb: int) -> StateArrays:
    """Zeroed storage for `nv` degrees of freedom, `nc` soles and `nb` bodies, the world's too."""
    sizes = {"nv": nv, "nc": nc, "nb": nb, "corners": MAX_VERTICES * nc}
    qpos, qvel = guarded_zeros(nv + 1), guarded_zeros(nv)
    s = StateArrays.allocate(sizes, qpos=qpos, qvel=qvel, motor_q=qpos[7:], motor_dq=qvel[6:])
    s.friction = 1.0
    return s


@compiled
def borne_weight(robot: RobotArrays, s: StateArrays) -> float:
    """The force that the ground gives at rest, with the load [N]."""
    return robot.mass * robot.gravity - s.load[0]


@compiled
def update_state(robot: RobotArrays, views: SimViews, s: StateArrays):
    """Fill `s` from the simulation, whose position and velocity stages are current."""
    _dynamics(robot, views, s)
    _momentum(robot, views, s)
    _soles(robot, views, s)
    _contact(robot, views, s)
    if robot.surfaces.shape[0] > 0:
        stand_on_terrain(robot, views, s)
    _bodies(robot, views, s)


@compiled
def _dynamics(robot: RobotArrays, views: SimViews, s: StateArrays):
    nv = s.M.shape[0]
    copy_into(views.qpos, s.qpos)
    copy_into(views.qvel, s.qvel)
    for i in range(nv):
        start = robot.M_rowadr[i]
        for k in range(robot.M_rownnz[i]):
            j = robot.M_colind[start + k]
            s.M[i, j] = views.M[start + k]
            s.M[j, i] = views.M[start + k]
        s.h[i] = views.qfrc_bias[i] - views.qfrc_passive[i]
    for i in range(3):
        for j in range(3):
            s.root_axes[i, j] = views.xmat[robot.root_body, 3 * i + j]


@compiled
def _momentum(robot: RobotArrays, views: SimViews, s: StateArrays):
    """P, L, A and its bias: A v̇ + A_bias is the wrench of the ground about the CoM."""
    nv = s.M.shape[0]
    R = s.root_axes
    for i in range(3):
        s.com[i] = views.subtree_com[robot.root_body, i]
    ox = s.com[0] - views.qpos[0]
    oy = s.com[1] - views.qpos[1]
    oz = s.com[2] - views.qpos[2]
    for j in range(nv):
        fx, fy, fz = s.M[0, j], s.M[1, j], s.M[2, j]
        s.A[0, j], s.A[1, j], s.A[2, j] = fx, fy, fz
        nx = R[0, 0] * s.M[3, j] + R[0, 1] * s.M[4, j] + R[0, 2] * s.M[5, j]
        ny = R[1, 0] * s.M[3, j] + R[1, 1] * s.M[4, j] + R[1, 2] * s.M[5, j]
        nz = R[2, 0] * s.M[3, j] + R[2, 1] * s.M[4, j] + R[2, 2] * s.M[5, j]
        s.A[3, j] = nx - (oy * fz - oz * fy)
        s.A[4, j] = ny - (oz * fx - ox * fz)
        s.A[5, j] = nz - (ox * fy - oy * fx)
    fx, fy, fz = s.h[0], s.h[1], s.h[2]
    nx = R[0, 0] * s.h[3] + R[0, 1] * s.h[4] + R[0, 2] * s.h[5]
    ny = R[1, 0] * s.h[3] + R[1, 1] * s.h[4] + R[1, 2] * s.h[5]
    nz = R[2, 0] * s.h[3] + R[2, 1] * s.h[4] + R[2, 2] * s.h[5]
    s.A_bias[0], s.A_bias[1], s.A_bias[2] = fx, fy, fz
    s.A_bias[3] = nx - (oy * fz - oz * fy)
    s.A_bias[4] = ny - (oz * fx - ox * fz)
    s.A_bias[5] = nz - (ox * fy - oy * fx)
    for i in range(6):
        total = 0.0
        for j in range(nv):
            total += s.A[i, j] * views.qvel[j]
        s.momentum[i] = total
    for i in range(3):
        s.com_vel[i] = s.momentum[i] / robot.mass


@compiled
def _soles(robot: RobotArrays, views: SimViews, s: StateArrays):
    """Pose, Jacobian and velocity-product acceleration of every sole; the heading frame."""
    nc = s.sole_point.shape[0]
    s.origin[:] = 0.0
    forward_x, forward_y = 0.0, 0.0
    for i in range(nc):
        body = robot.sole_body[i]
        point, axes = s.sole_point[i], s.sole_axes[i]
        for a in range(3):
            offset = 0.0
            for b in range(3):
                offset += views.xmat[body, 3 * a + b] * robot.sole_position[i, b]
                total = 0.0
                for c in range(3):
                    total += views.xmat[body, 3 * a + c] * robot.sole_rotation[i, c, b]
                axes[a, b] = total
            point[a] = views.xpos[body, a] + offset
            s.origin[a] += point[a] / nc
        forward_x += axes[0, 0]
        forward_y += axes[1, 0]
        _sole_jacobian(robot, views, s, i)
    norm = np.sqrt(forward_x * forward_x + forward_y * forward_y)
    s.heading[0] = forward_x / norm if norm > 1e-9 else 1.0
    s.heading[1] = forward_y / norm if norm > 1e-9 else 0.0


@compiled
def _sole_jacobian(robot: RobotArrays, views: SimViews, s: StateArrays, i: int):
    """Rows 6i..6i+6 of J, J v and J̇ v, see `point_jacobian`."""
    point, tree, rows = s.sole_point[i], views.subtree_com[robot.tree_body], slice(6 * i, 6 * i + 6)
    point_jacobian(
        views.cdof, views.cdof_dot, views.qvel, robot.chain[i], robot.chain_length[i],
        point[0] - tree[0], point[1] - tree[1], point[2] - tree[2],
        s.J[rows], s.J_v[rows], s.Jdot_v[rows],
    )  # fmt: skip


@compiled
def _contact(robot: RobotArrays, views: SimViews, s: StateArrays):
    """Total ground wrench, CoP and capture point; which feet touch the ground.

    The ground is the only thing outside the body, and joint limits and friction do not act on
    the root: so the root rows of the constraint force are the ground's wrench. They belong to the
    root's pose before the last step.
    """
    R = s.root_axes
    dt, f, v = robot.timestep, views.qfrc_constraint, views.qvel
    fx, fy, fz = f[0], f[1], f[2]
    mx = f[3] - dt * (v[4] * f[5] - v[5] * f[4])
    my = f[4] - dt * (v[5] * f[3] - v[3] * f[5])
    mz = f[5] - dt * (v[3] * f[4] - v[4] * f[3])
    nx = R[0, 0] * mx + R[0, 1] * my + R[0, 2] * mz
    ny = R[1, 0] * mx + R[1, 1] * my + R[1, 2] * mz
    nz = R[2, 0] * mx + R[2, 1] * my + R[2, 2] * mz
    x = views.qpos[0] - dt * v[0]
    y = views.qpos[1] - dt * v[1]
    z = views.qpos[2] - dt * v[2]
    s.contact_wrench[0], s.contact_wrench[1], s.contact_wrench[2] = fx, fy, fz
    s.contact_wrench[3] = nx + y * fz - z * fy
    s.contact_wrench[4] = ny + z * fx - x * fz
    s.contact_wrench[5] = nz + x * fy - y * fx
    if fz > 1e-3 * robot.mass * robot.gravity:
        s.cop[0] = -s.contact_wrench[4] / fz
        s.cop[1] = s.contact_wrench[3] / fz
    else:  # no support: there is no CoP; the middle of the soles is what can be reached next
        s.cop[0], s.cop[1] = s.origin[0], s.origin[1]
    height = max(s.com[2] - s.origin[2], 0.2 * robot.height_com)
    s.omega = compiled_rate(robot.gravity, height)
    for a in range(2):
        s.capture_point[a] = s.com[a] + s.com_vel[a] / s.omega
    feet = 0.0
    for i in range(s.contacts.shape[0]):
        found = views.sensordata[robot.sole_sensor[i]]
        s.contacts[i] = 1.0 if found > 0.0 else 0.0
        feet += found
    s.other_contacts = views.sensordata[robot.ground_sensor] - feet


@compiled
def _bodies(robot: RobotArrays, views: SimViews, s: StateArrays):
    """Fill the places of the bodies and the axes of the dofs, which any point's J needs."""
    for i in range(s.body_position.shape[0]):
        for a in range(3):
            s.body_position[i, a] = views.xpos[i, a]
            for b in range(3):
                s.body_axes[i, a, b] = views.xmat[i, 3 * a + b]
    for d in range(s.dof_axes.shape[0]):
        for a in range(6):
            s.dof_axes[d, a] = views.cdof[d, a]
            s.dof_axes_dot[d, a] = views.cdof_dot[d, a]
    copy_into(views.subtree_com[robot.tree_body], s.tree_com)


@compiled
def stand_on_terrain(robot: RobotArrays, views: SimViews, s: StateArrays):
    """What is relative to the ground where that is not z = 0, and which feet touch edges.

    The origin is as high as the soles that touch the ground are in the mean, without one as the
    lowest sole. The CoP lies in the plane through it, and ω is that of the CoM's height above it.
    """
    touching, height, lowest = 0, 0.0, np.inf
    for i in range(s.sole_point.shape[0]):
        x, y, z = s.sole_point[i, 0], s.sole_point[i, 1], s.sole_point[i, 2]
        s.ground[i] = ground_height(robot.surfaces, robot.floor, x, y)
        lowest = min(lowest, z)
        if s.contacts[i] > 0.5:
            touching, height = touching + 1, height + z
            if touches_edge(robot, views, s, i):
                s.edges[i] = 1.0
    s.origin[2] = height / touching if touching > 0 else lowest
    fz = s.contact_wrench[2]
    if fz > 1e-3 * robot.mass * robot.gravity:
        for a in range(2):
            s.cop[a] += s.origin[2] * s.contact_wrench[a] / fz
    above = max(s.com[2] - s.origin[2], 0.2 * robot.height_com)
    s.omega = compiled_rate(robot.gravity, above)
    for a in range(2):
        s.capture_point[a] = s.com[a] + s.com_vel[a] / s.omega


@compiled
def touches_edge(robot: RobotArrays, views: SimViews, s: StateArrays, i: int) -> bool:
    """Return whether a foot on the ground presses against a step, or reaches over the edge of the
    surface that it stands on."""
    first = robot.edge_sensor[i]
    for slot in range(SLOTS):
        found = views.sensordata[first + 4 * slot] > 0.0
        if found and abs(views.sensordata[first + 4 * slot + 3]) < STEEP:
            return True
    axes, surfaces = s.sole_axes[i], robot.surfaces
    own = surface_below(surfaces, s.sole_point[i, 0], s.sole_point[i, 1])
    for k in range(robot.sole_vertices[i]):
        u, v = robot.sole_polygon[i, k, 0], robot.sole_polygon[i, k, 1]
        x = s.sole_point[i, 0] + axes[0, 0] * u + axes[0, 1] * v
        y = s.sole_point[i, 1] + axes[1, 0] * u + axes[1, 1] * v
        below = ground_height(surfaces, robot.floor, x, y)
        if abs(below - surface_height(surfaces, own, robot.floor, x)) > EDGE:
            return True
    return False


AIRBORNE = 0.02  # [h]: a sole without contact that is this far above the lowest one swings


@compiled
def update_support(robot: RobotArrays, s: StateArrays):
    """Update the convex hull of the vertices of all soles but swing feet (counter-clockwise,
    monotone chain). A foot that rocks on its edge still counts; one that steps does not."""
    n, lowest = 0, np.inf
    for i in range(s.sole_point.shape[0]):
        lowest = min(lowest, s.sole_point[i, 2])
    ceiling = lowest + AIRBORNE * robot.height_com
    corners = robot.sole_polygon.shape[0] * robot.sole_polygon.shape[1]
    points = np.empty((corners + 2 * GAP, 2))[GAP:]
    for i in range(robot.sole_vertices.shape[0]):
        if s.sole_point[i, 2] > ceiling and s.contacts[i] < 0.5:
            continue
        axes = s.sole_axes[i]
        for k in range(robot.sole_vertices[i]):
            u, v = robot.sole_polygon[i, k, 0], robot.sole_polygon[i, k, 1]
            points[n, 0] = s.sole_point[i, 0] + axes[0, 0] * u + axes[0, 1] * v
            points[n, 1] = s.sole_point[i, 1] + axes[1, 0] * u + axes[1, 1] * v
            n += 1
    hull = np.empty((2 * n + 1 + 2 * GAP, 2))[GAP:]
    size = convex_hull(points, n, 0.0, hull)
    for i in range(size):
        s.support[i, 0], s.support[i, 1] = hull[i, 0], hull[i, 1]
    s.support_size = size


@compiled
def support_distance(s: StateArrays, x: float, y: float) -> float:
    """Signed distance [m] from (x, y) to the support polygon's edge, > 0 inside."""
    distance = np.inf
    size = s.support_size
    for i in range(size):
        ax, ay = s.support[i, 0], s.support[i, 1]
        ex = s.support[(i + 1) % size, 0] - ax
        ey = s.support[(i + 1) % size, 1] - ay
        inside = (ex * (y - ay) - ey * (x - ax)) / np.sqrt(ex * ex + ey * ey)
        distance = min(distance, inside)
    return distance
