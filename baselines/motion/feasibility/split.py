"""The ground's wrench, shared by the soles; and what the motors then have to do."""

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from poise.baselines.solvers import QP, make_solver
from poise.baselines.whole_body.contacts.wrench_cone import robot_cones
from poise.envs.robots.robot import Robot

from .trajectory import PlantedRobot, Trajectory, sample_trajectory

LEAST = 0.1  # weight of the wrenches beside the torques
SUM = 1e4  # weight of what the soles' wrenches lack of the ground's


def split_wrench(robot: Robot, trajectory: Trajectory) -> np.ndarray:
    """(n, 6 nc) wrenches of the soles at their points, world axes, that are easiest to bear.

    min ‖τ/τ_max‖² + 0.1 Σ ‖[f_i; n_i/ℓ]/(m g)‖² + 10⁴ ‖(Σ w_i − w)/(m g)‖²  s.t.  R w_i ≤ 0,

    with τ = M v̇ + h − Jᵀ w in the motors' rows, ℓ half the sole's size square to each axis, and
    the exact cone of every sole [Caron15]. A wrench that the soles cannot give at all is given as
    nearly as they can.
    """
    unit, limit = robot.units.force, np.asarray(robot.torque_limit)
    G = wrench_sums(trajectory)
    B = unit * (trajectory.jacobians[:, :, robot.motor_dofs] / limit).transpose(0, 2, 1)
    bears = np.repeat(trajectory.planted, 6, axis=1)  # a swing foot bears nothing
    G, B = G * bears[:, None], B * bears[:, None]
    b, wanted = trajectory.motors / limit, trajectory.wrench / unit
    size = np.concatenate([np.append(np.ones(3), _lever(sole.polygon)) for sole in robot.soles])
    H = B.transpose(0, 2, 1) @ B + SUM * G.transpose(0, 2, 1) @ G + np.diag(LEAST / size**2)
    g = -np.einsum("kmi,km->ki", B, b) - SUM * np.einsum("kji,kj->ki", G, wanted)
    cones = world_cones(robot, trajectory)
    below = np.full(cones.shape[1], -np.inf), np.zeros(cones.shape[1])
    solver = make_solver("active-set")
    solved = [solver.solve(QP(H[k], g[k], cones[k], *below)).x for k in range(len(H))]
    return unit * np.array(solved).reshape(len(H), -1) * bears


def joint_motor_torques(robot: Robot, trajectory: Trajectory) -> np.ndarray:
    """(n, nu) torques [N·m] of the motors: τ = M v̇ + h − Jᵀ w in their rows."""
    wrenches = split_wrench(robot, trajectory)
    borne = np.einsum("kwv,kw->kv", trajectory.jacobians, wrenches)
    return np.asarray(trajectory.motors - borne[:, robot.motor_dofs])


def wrench_sums(trajectory: Trajectory) -> np.ndarray:
    """(n, 6, 6 nc) by which wrenches at the soles' points are one about c."""
    samples, count = trajectory.sole_points.shape[:2]
    G = np.zeros((samples, 6, 6 * count))
    for i in range(count):
        G[:, :, 6 * i : 6 * i + 6] = np.eye(6)
        G[:, 3:, 6 * i : 6 * i + 3] = _skew(trajectory.sole_points[:, i] - trajectory.com)
    return G


def world_cones(robot: Robot, trajectory: Trajectory) -> np.ndarray:
    """(n, r, 6 nc) rows of the soles' cones for wrenches in world axes."""
    cones, samples = robot_cones(robot, 1.0, 1.0), len(trajectory.times)
    count, rows = cones.shape[:2]
    out = np.zeros((samples, count * rows, 6 * count))
    for i in range(count):
        back = trajectory.sole_axes[:, i].transpose(0, 2, 1)
        part = out[:, i * rows : (i + 1) * rows, 6 * i : 6 * i + 6]
        part[:, :, :3], part[:, :, 3:] = cones[i, :, :3] @ back, cones[i, :, 3:] @ back
    return out


def _lever(polygon: np.ndarray) -> np.ndarray:
    """(3,) half sizes [m] of a sole: left for the moment about forward, forward for left, mean."""
    forward, left = 0.5 * np.ptp(polygon, axis=0)
    return np.array([left, forward, 0.5 * (forward + left)])


def _skew(vectors: np.ndarray) -> np.ndarray:
    """(n, 3, 3) with which a cross product from the left is a product."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    rows = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])
    return np.moveaxis(rows, 2, 0)


DIRECTIONS = 12


def bearable_region(
    planted: PlantedRobot, q: np.ndarray, load: float = 1.0, share: float = 1.0
) -> np.ndarray | None:
    """(k, 2) region of the ground over which motors can hold a posture `q` (nj,) under a load.

    A corner is the ZMP that is furthest in one of 12 directions d,

        max dᵀp  s.t.  Σ w_i = [f; (p − c) × f],  R w_i ≤ 0,  |λ h − Jᵀ w| ≤ s τ_max,

    f = [0, 0, λ m g], a linear program over the wrenches of the soles: the polygon inside the
    region of [Orsolino20]. `load` λ is over the weight, as if gravity were so many times as large;
    `share` s is of the motors' limits. World axes, counter-clockwise [m]. None if the motors cannot
    hold the posture.
    """
    robot, still = planted.robot, np.zeros_like(q)
    t = sample_trajectory(planted, lambda _: (q, still, still), np.zeros(1))
    unit, limit = robot.units.force, share * np.asarray(robot.torque_limit)
    sums, cones = wrench_sums(t)[0], world_cones(robot, t)[0]
    borne = unit * t.jacobians[0][:, robot.motor_dofs].T / limit[:, None]
    held = load * t.motors[0] / limit
    rows = np.vstack([cones, -borne, borne])
    bounds = np.concatenate([np.zeros(len(cones)), 1.0 - held, 1.0 + held])
    corners = []
    for angle in np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False):
        price = np.cos(angle) * sums[4] - np.sin(angle) * sums[3]  # p − c = (−n_y, n_x)/(m g)
        found = linprog(price, rows, bounds, sums[[0, 1, 2, 5]], [0.0, 0.0, load, 0.0],
                        bounds=(None, None))  # fmt: skip
        if found.status != 0:
            return None
        moment = sums[3:5] @ found.x / load
        corners.append(t.com[0, :2] + [-moment[1], moment[0]])
    points = np.array(corners)
    return points[ConvexHull(points).vertices]
