"""How much a pendulum with a flywheel can take in steps that the legs can do.

    python -m tests.performance.step_limit [--robot humanoid] [--body torso] [--lean 15]

The largest impulse J in each direction for which footholds, CoPs and turns exist, by linear
programming, for the better of both feet and for the best of some times T_1, T_2 of the swings:

    m c̈ = m ω² (c − p) − e(L̇_g)/z + F      pendulum at constant height z, ω² = g/z
    L̇ = L̇_g + (r × F)                      the push F itself turns the body: lever r above c
    p where the sole on the ground puts it with its ankle, at first both (`CopRegion`)
    |L̇_g| within the hips' torque, |∫ L dt| ≤ Λ, as in `flywheel_limit`; on one foot about x within
      what one hip's abductor has, for it alone holds the pelvis level
    |f_k − f_{k−2}| ≤ ¼ a T²               a foot from rest to rest in a swing of time T
    f_k − c(t_k) within the hips' ranges, the trunk leaning by at most `--lean` degrees more
    feet do not cross: they stay a sole's width apart, in their standing order
    at the end: ċ = 0, L = 0

a is the largest horizontal acceleration that the leg's motors give the lifted foot in the standing
posture, the root at rest: half of it to speed the foot up, half to stop it. The first foot leaves
`--begin` s after the push begins, the next ones as soon as the one before has landed, four in all.
The control knows the push in advance, and feet land exactly where they are wanted: what a
controller can reach is less. A changing height and what a swinging leg does to the body are outside
this model, so it is an estimate, not a proof.
"""

import argparse
from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array

from poise.baselines.balance.references.legs import nominal_feet
from poise.baselines.balance.stepping.planning.cop_region import cop_region
from poise.baselines.registry import controller_config
from poise.baselines.whole_body.momentum_qp import com_offset
from poise.envs.compiled.maths.polygons import half_planes
from poise.envs.physics.arrays import dof_chain
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot

from .flywheel_limit import turn_budget

STEP, STEPS, SUBSTEPS = 0.025, 72, 5  # [s]
FEET = 4  # steps
TIMES = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5)  # of the first swing, and of the later ones [s]
COMPASS = np.stack([np.cos(np.arange(0, 2 * np.pi, np.pi / 8)),
                    np.sin(np.arange(0, 2 * np.pi, np.pi / 8))], axis=1)  # fmt: skip


@dataclass
class Body:
    """What the linear programs need of a robot."""

    mass: float
    height: float
    omega2: float  # [1/s²]
    start: np.ndarray  # (2,) the CoM at rest [m]
    feet: np.ndarray  # (2, 2) soles [m]
    both: tuple[np.ndarray, np.ndarray]  # N, b: N p ≤ b
    alone: list[tuple[np.ndarray, np.ndarray]]  # the same of each sole, about it
    swing: list[np.ndarray]  # (16,) of each foot: acceleration along `COMPASS` [m/s²]
    reach: list[tuple[np.ndarray, np.ndarray]]  # N, b of each foot about the CoM
    apart: float  # least distance of the soles' middles to the side [m]
    budget: np.ndarray  # (2, 2) Λ


def swing_accelerations(robot, sole):
    """(16,) the largest acceleration [m/s²] of the foot along each direction of `COMPASS`.

    a = J M⁻¹ τ with the leg's motors within their limits; the foot neither sideways to the
    direction nor up, and level. M and J of the leg alone, in the standing posture.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    dofs = [dof for dof in dof_chain(model, robot.soles[sole].body_id) if dof >= 6]
    limit = np.zeros(model.nv)
    limit[np.asarray(robot.motor_dofs)] = robot.torque_limit
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    rows, place = np.zeros((6, model.nv)), robot.soles[sole]
    point = data.xpos[place.body_id] + data.xmat[place.body_id].reshape(3, 3) @ place.position
    mujoco.mj_jac(model, data, rows[:3], rows[3:], point, place.body_id)
    gain = rows[:, dofs] @ np.linalg.inv(full[np.ix_(dofs, dofs)])
    found = []
    for e in COMPASS:
        across = np.array([-e[1], e[0]])
        still = np.vstack([across @ gain[:2], gain[2:5]])  # not sideways, not up, no roll or pitch
        result = linprog(-(e @ gain[:2]), A_eq=still, b_eq=np.zeros(4),
                         bounds=np.stack([-limit[dofs], limit[dofs]], axis=1))  # fmt: skip
        found.append(-result.fun)
    return np.array(found)


def measure(robot, given):
    """The `Body` of a robot."""
    simulation = Simulation(robot)
    mujoco.mj_forward(robot.model, simulation.data)
    feet, region = nominal_feet(robot), cop_region(robot, fraction=1.0)
    hip = robot.height_com  # of the pendulum's leg
    reach = []
    for foot in range(2):
        side = np.sign(feet[foot, 1] - feet[:, 1].mean())
        ranges = np.radians([given.abduction, given.flexion, given.extension])
        out, ahead, back = hip * np.sin(ranges + np.radians(given.lean))
        offset = feet[foot, 1] - feet[:, 1].mean()
        N = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, side]])
        reach.append((N, np.array([ahead, back, out + side * offset])))
    return Body(
        mass=robot.mass,
        height=robot.height_com,
        omega2=simulation.arrays.gravity / robot.height_com,
        start=feet[:, :2].mean(axis=0)
        + [com_offset(robot, controller_config("momentum-qp").com), 0],
        feet=feet[:, :2],
        both=half_planes(region.both(feet, 0.0)),
        alone=[half_planes(polygon) for polygon in region.alone],
        swing=[swing_accelerations(robot, foot) for foot in range(2)],
        reach=reach,
        apart=float(max(np.ptp(sole.polygon[:, 1]) for sole in robot.soles)) + 0.01,
        budget=turn_budget(simulation),
    )


def limit(body, direction, duration, lever, torque, begin, first, times):
    """The largest J [N·s] along `direction` [deg], the foot `first` leaving first; 0: none.

    `torque` are the hips' about both axes, and one hip's about x [N·m].
    """
    n, m = STEPS, body.mass
    unknowns = 4 * n + 2 * FEET + 1  # p (n, 2), L̇_g (n, 2), f (FEET, 2), J
    eye = np.eye(unknowns)
    along = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    foothold = [eye[4 * n + 2 * k : 4 * n + 2 * k + 2] for k in range(FEET)]
    which = [(first + k) % 2 for k in range(FEET)]
    landing = np.round((begin + np.cumsum([times[0], *[times[1]] * (FEET - 1)])) / STEP).astype(int)
    c, v = np.zeros((2, unknowns)), np.zeros((2, unknowns))
    L, turn, rest, rest_v = np.zeros((2, unknowns)), np.zeros((2, unknowns)), *np.zeros((2, 2))
    rest += body.start
    rows, bounds = [], []

    def hold(matrix, most):
        rows.extend(matrix)
        bounds.extend(np.broadcast_to(most, len(matrix)))

    h = STEP / SUBSTEPS
    for k in range(n):
        p = eye[2 * k : 2 * k + 2]
        rate = eye[2 * n + 2 * k : 2 * n + 2 * k + 2]
        landed = int(np.sum(landing <= k))
        if k * STEP >= begin - 1e-9 and k < landing[-1]:
            hold([rate[0], -rate[0]], torque[1])
        if k * STEP < begin - 1e-9:
            hold(body.both[0] @ p, body.both[1])
        elif landed == 0:
            N, b = body.alone[1 - first]
            hold(N @ p, b + N @ body.feet[1 - first])
        else:
            N, b = body.alone[which[landed - 1]]
            hold(N @ (p - foothold[landed - 1]), b)
        share = np.clip((duration - k * STEP) / STEP, 0.0, 1.0)
        push = np.outer(share * along / duration, eye[-1])
        for _ in range(SUBSTEPS):
            # a moment about +y takes horizontal force along −x, one about +x force along +y
            spun = np.stack([-rate[1], rate[0]]) / (m * body.height)
            v = v + h * (body.omega2 * (c - p) + spun + push / m)
            rest_v = rest_v + h * body.omega2 * rest
            c, rest = c + h * v, rest + h * rest_v
            L = L + h * (rate + lever * np.stack([-push[1], push[0]]))
            turn = turn + h * L
        for axis in range(2):
            hold([turn[axis], -turn[axis]], [body.budget[axis, 1], body.budget[axis, 0]])
        for step in np.flatnonzero(landing == k + 1):
            foot, (N, b) = which[step], body.reach[which[step]]
            hold(N @ (foothold[step] - c), b + N @ rest)
            far = body.swing[foot] * 0.25 * times[min(step, 1)] ** 2
            before = foothold[step - 2] if step > 1 else np.zeros((2, unknowns))
            hold(COMPASS @ (foothold[step] - before),
                 far + (0.0 if step > 1 else COMPASS @ body.feet[foot]))  # fmt: skip
            side = np.sign(body.feet[foot, 1] - body.feet[1 - foot, 1])
            other = foothold[step - 1] if step else np.zeros((2, unknowns))
            stands = 0.0 if step else side * body.feet[1 - foot, 1]
            hold([side * (other[1] - foothold[step][1])], -body.apart - stands)
    result = linprog(
        -eye[-1], A_ub=csr_array(np.array(rows)), b_ub=np.array(bounds),
        A_eq=np.vstack([v, L]), b_eq=np.concatenate([-rest_v, np.zeros(2)]),
        bounds=[(None, None)] * (2 * n) + [(-torque[0], torque[0])] * (2 * n)
        + [(None, None)] * (2 * FEET) + [(0.0, None)],
    )  # fmt: skip
    return float(result.x[-1]) if result.success else 0.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--body", help="that is pushed; by default the trunk")
    parser.add_argument("--duration", type=float, default=0.1)
    parser.add_argument("--begin", type=float, default=0.05, help="the first foot leaves [s]")
    parser.add_argument("--hips", type=float, default=240.0, help="largest L̇ of the ground [N·m]")
    parser.add_argument("--abductor", type=float, default=40.0, help="of one hip [N·m]")
    parser.add_argument("--lean", type=float, default=15.0, help="of the trunk [degree]")
    parser.add_argument("--abduction", type=float, default=25.0, help="of a hip [degree]")
    parser.add_argument("--flexion", type=float, default=50.0, help="of a hip [degree]")
    parser.add_argument("--extension", type=float, default=20.0, help="of a hip [degree]")
    parser.add_argument("--directions", type=int, default=16)
    given = parser.parse_args()
    robot = load_robot(given.robot)
    given.body = given.body or push_bodies(robot)[0]
    body = measure(robot, given)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    lever = float(data.body(given.body).xipos[2] - robot.height_com)
    ahead, side = body.swing[0][0], body.swing[0][4]
    print(f"a foot is accelerated by {ahead:.0f} m/s² ahead, {side:.0f} to the side")
    print("direction   limit per mass   first foot, T_1, T_2 [s]")
    found, torque = [], (given.hips, given.abductor)
    for direction in np.arange(given.directions) * 360.0 / given.directions:
        best = max(
            (limit(body, direction, given.duration, lever, torque, given.begin, foot, times),
             foot, times)
            for foot, times in product((0, 1), product(TIMES, TIMES))
        )  # fmt: skip
        found.append(best[0])
        name, (first, later) = robot.soles[best[1]].name, best[2]
        print(f"{direction:8.1f}°  {best[0]:6.1f} N·s  {best[0] / body.mass:6.3f} N·s/kg   "
              f"{name}, {first:.2f}, {later:.2f}", flush=True)  # fmt: skip
    mean, worst = np.mean(found), np.min(found)
    print(f"    mean   {mean:6.1f} N·s  {mean / body.mass:6.3f} N·s/kg   "
          f"worst {worst / body.mass:.3f} N·s/kg")  # fmt: skip


if __name__ == "__main__":
    main()
