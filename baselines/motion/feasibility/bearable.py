"""Where the centre of pressure may be for the motors' sake."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from .split import sole_cones, wrench_sums
from .trajectory import PlantedRobot, sample_trajectory

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
    sums, cones = wrench_sums(t)[0], sole_cones(robot, t)[0]
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
