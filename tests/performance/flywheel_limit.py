"""How much a pendulum with a flywheel can take, feet in place: what is left above the baseline.

    python -m tests.performance.flywheel_limit [--robot humanoid] [--body torso] [--duration 0.1]

The largest impulse J in each direction for which a control exists, found by linear programming:

    m c̈ = m ω² (c − p) − e(L̇_g)/z + F      pendulum at constant height z, ω² = g/z
    L̇ = L̇_g + (r × F)                      the push F itself turns the body: lever r above c
    p where both soles can put it with the torques of their ankles (`CopRegion`)
    |L̇_g| within the hips' torque
    |∫ L dt| ≤ Λ                             the turn that the joints allow
    at the end: ċ = 0, L = 0, c over the soles

Λ comes from another linear program: the largest A_L Δq [kg m²·rad] with the soles fixed, the CoM
fixed in the plane (its height free within −0.3 h … +0.1 h), joints in their ranges and the root
turned by at most 90°, linear about the standing posture. The control knows the push in advance
and moves without inertia: what a controller can reach is less. A changing height and joints far
from the linear range are outside this model, so it is an estimate, not a proof.
"""

import argparse

import mujoco
import numpy as np
from scipy.optimize import linprog

from poise.baselines.balance.references.legs import nominal_feet
from poise.baselines.balance.stepping.planning.cop_region import cop_region
from poise.baselines.registry import controller_config
from poise.baselines.whole_body.momentum_qp import com_offset
from poise.envs.compiled.maths.polygons import half_planes
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.push_limits import load_limits

STEP, STEPS, SUBSTEPS = 0.025, 100, 5  # [s]


def turn_budget(simulation):
    """(2, 2) Λ about x and y [kg m² rad], backward and forward turns: columns −, +."""
    state, robot = simulation.state, simulation.robot
    low = np.concatenate([np.full(3, -1.0), np.full(3, -np.pi / 2), robot.joint_range[:, 0]])
    high = np.concatenate([np.full(3, 1.0), np.full(3, np.pi / 2), robot.joint_range[:, 1]])
    low[6:] -= robot.standing_qpos[7:]
    high[6:] -= robot.standing_qpos[7:]
    fixed = np.vstack([state.J, state.A[:2]])
    height = np.vstack([state.A[2], -state.A[2]]) / robot.mass
    room = np.array([0.1, 0.3]) * robot.height_com
    budget = np.zeros((2, 2))
    for axis in range(2):
        for column, sign in enumerate((-1.0, 1.0)):
            result = linprog(
                -sign * state.A[3 + axis], A_ub=height, b_ub=room, A_eq=fixed,
                b_eq=np.zeros(len(fixed)), bounds=np.column_stack([low, high]),
            )  # fmt: skip
            budget[axis, column] = -result.fun
    return budget


def cop_rows(robot):
    """N, b with N p ≤ b: where both soles put p with the torques of their ankles [m]."""
    return half_planes(cop_region(robot, fraction=1.0).both(nominal_feet(robot), 0.0))


def limit(simulation, start, direction, duration, lever, hip_torque):
    """The largest J [N·s] along `direction` [deg] from a CoM at rest at `start` (2,)."""
    robot, gravity = simulation.robot, simulation.arrays.gravity
    m, z = robot.mass, robot.height_com
    omega2 = gravity / z
    n, unknowns = STEPS, 4 * STEPS + 1  # p (n, 2), L̇_g (n, 2), J
    along = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    budget = turn_budget(simulation)
    N, b = cop_rows(robot)
    c, v = np.zeros((2, unknowns)), np.zeros((2, unknowns))
    L, turn, rest = np.zeros((2, unknowns)), np.zeros((2, unknowns)), start.copy()
    rest_v, rows, bounds = np.zeros(2), [], []
    h = STEP / SUBSTEPS
    for k in range(n):
        p, rate, push = np.zeros((3, 2, unknowns))
        p[:, 2 * k : 2 * k + 2] = np.eye(2)
        rate[:, 2 * n + 2 * k : 2 * n + 2 * k + 2] = np.eye(2)
        share = np.clip((duration - k * STEP) / STEP, 0.0, 1.0)
        push[:, -1] = share * along / duration
        for _ in range(SUBSTEPS):
            # a moment about +y takes horizontal force along −x, one about +x force along +y
            spun = np.stack([-rate[1], rate[0]]) / (m * z)
            v += h * (omega2 * (c - p) + spun + push / m)
            rest_v = rest_v + h * omega2 * rest
            c += h * v
            rest = rest + h * rest_v
            L += h * (rate + lever * np.stack([-push[1], push[0]]))
            turn += h * L
        for axis in range(2):
            rows += [turn[axis].copy(), -turn[axis].copy()]
            bounds += [budget[axis, 1], budget[axis, 0]]
    inside = np.zeros((n * len(N), unknowns))
    for k in range(n):
        inside[k * len(N) : (k + 1) * len(N), 2 * k : 2 * k + 2] = N
    rows += list(N @ c)
    bounds += list(b - N @ rest)
    result = linprog(
        np.eye(unknowns)[-1] * -1.0,
        A_ub=np.vstack([inside, np.array(rows)]), b_ub=np.concatenate([np.tile(b, n), bounds]),
        A_eq=np.vstack([v, L]), b_eq=np.concatenate([-rest_v, np.zeros(2)]),
        bounds=[(None, None)] * (2 * n) + [(-hip_torque, hip_torque)] * (2 * n) + [(0.0, None)],
    )  # fmt: skip
    if not result.success:
        raise SystemExit(f"{direction}°: {result.message}")
    return float(result.x[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--body", help="that is pushed; by default the trunk")
    parser.add_argument("--duration", type=float, default=0.1)
    parser.add_argument("--hips", type=float, default=240.0, help="largest L̇ of the ground [N·m]")
    given = parser.parse_args()
    robot = load_robot(given.robot)
    given.body = given.body or push_bodies(robot)[0]
    simulation = Simulation(robot)
    mujoco.mj_forward(robot.model, simulation.data)
    lever = float(simulation.data.body(given.body).xipos[2] - robot.height_com)
    budget = turn_budget(simulation)
    print(f"lever of {given.body} above the CoM {lever:.2f} m; Λ about x {budget[0].round(2)},")
    print(f"about y {budget[1].round(2)} kg m² rad (−, +); L̇ within {given.hips:.0f} N·m")
    ahead = com_offset(robot, controller_config("momentum-qp").com)
    start = nominal_feet(robot)[:, :2].mean(axis=0) + [ahead, 0.0]
    limits = load_limits(robot)
    print("direction  flywheel limit  baseline J50  J50/limit  limit per mass")
    best, measured = [], []
    for direction in np.arange(0.0, 360.0, 22.5):
        best.append(limit(simulation, start, direction, given.duration, lever, given.hips))
        j50 = float("nan") if limits.table is None else limits.table(direction)
        measured.append(j50)
        print(f"{direction:8.1f}°  {best[-1]:10.1f} N·s  {j50:8.1f} N·s  {j50 / best[-1]:8.2f}"
              f"  {best[-1] / robot.mass:10.3f} N·s/kg")  # fmt: skip
    ratio = np.mean(measured) / np.mean(best)
    print(f"    mean   {np.mean(best):10.1f} N·s  {np.mean(measured):8.1f} N·s  {ratio:8.2f}"
          f"  {np.mean(best) / robot.mass:10.3f} N·s/kg")  # fmt: skip


if __name__ == "__main__":
    main()
