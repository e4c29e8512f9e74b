"""What the equations ask of a stance knee: `python -m tests.performance.knee_bound`.

In the sagittal plane, over a stance of a linear pendulum, x − p = A sinh ωt, which goes from −ℓ/2
to ℓ/2 in T. The ground's force acts at p along the line to the CoM at (x, z). Legs without mass:
the knee at (x_k, z_k) bears

    τ/m = g ((x_k − p) − (x − p) z_k/z),

positive where it extends. The models say where the knee is: `rigid` is a leg of constant length,
`spring` one of z = ℓ₀ (1 − 1/κ), κ = k ℓ₀/(m g), `double` has the flexion that frees the knee, at
least β₀. Free are p, in the sole and within the ankle's motor, and how far the CoM is ahead of the
hip, up to a trunk that leans by 20°: the least mean |τ|/m over both is the bound.

A leg that swings has a mass. Its angular momentum about the CoM has to change: from −v/h to a peak
and back about the hip, by ℓ/h in T, at least by |α| = 4 (ℓ/T + v)/(h T) in the mean. L̇ = I α moves
the CoP by L̇/(m g) from where the force points, so it adds L̇/m to what the knee bears, unless the
trunk turns.

Soles are flat while a foot leaves and the other bears. The leg behind, straight but for 2°, then
holds the hip down, ℓ/2 + v t/2 ahead of its ankle with t on both feet, so the leg ahead is bent.
Its knee bears nothing where that is the flexion that frees it with some CoP. In long steps it is
more, and the least torque over CoP and lean is what a second-order pendulum's knee has to bear.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.baselines.walking.models.double import free_flexion
from poise.baselines.walking.models.legs import leg_arrays
from poise.baselines.walking.models.two_rods import flexion_at, length_at, rod_angles
from poise.envs.robots.robot import Robot, load_robot

G = 9.81
STANCE, STEP = 0.36, 0.22  # of walk-double at 0.5 m/s: T [s], ℓ [m]
LEAST = np.radians(9.36)  # β of walk-double
RIGID, KAPPA = np.radians(25.0), 18.0  # of walk-rigid and walk-spring
RISE = np.radians(5.0)  # β of the spring's ℓ₀
LEAN = np.radians(20.0)  # of the trunk, at most
BOTH = 0.07  # on both feet [s]
STRAIGHT = np.radians(2.0)  # β of the leg behind
STEPS = ((0.22, 0.5), (0.33, 0.8), (0.43, 1.0), (0.6, 1.0))  # of walk-double, and the document's


@dataclass(frozen=True)
class Plane:
    """A robot in the sagittal plane [m]; CoP and CoM forward from the ankle and from the hip."""

    thigh: float
    shank: float
    ankle: float  # height over the sole
    above: float  # of the CoM over the hip
    cop: tuple[float, float]
    lean: float  # the CoM ahead of the hip, at most


def plane_of(robot: Robot) -> Plane:
    """Lengths of a robot, and what its sole and ankle let the CoP do."""
    model, data, legs = robot.model, mujoco.MjData(robot.model), leg_arrays(robot)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    body, place = legs.ankle_body[0], legs.ankle_place[0]
    ankle = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
    carrier, offset = legs.hip_body[0], legs.hip_place[0]
    hip = data.xpos[carrier] + data.xmat[carrier].reshape(3, 3) @ offset
    sole = robot.soles[0]
    corners = data.xpos[sole.body_id] + (
        (sole.position + np.c_[sole.polygon, np.zeros(len(sole.polygon))])
        @ data.xmat[sole.body_id].reshape(3, 3).T
    )
    names = list(robot.joint_names)
    motor = next(i for i, n in enumerate(names) if n.startswith(("ankle_flex", "right_ankle_y")))
    by_motor = float(robot.torque_limit[motor]) / (robot.mass * G)
    heel, toe = corners[:, 0].min() - ankle[0], corners[:, 0].max() - ankle[0]
    com = (model.body_mass @ data.xipos) / robot.mass
    trunk = data.xpos[robot.root_body_id][2] - hip[2]
    return Plane(legs.thigh, legs.shank, float(ankle[2]), float(com[2] - hip[2]),
                 (max(heel, -by_motor), min(toe, by_motor)),
                 float(0.6 * max(trunk, 0.2) * np.sin(LEAN)))  # fmt: skip


def knee_torque(body: Plane, model: str, cop: float, ahead: float) -> np.ndarray:
    """(n,) τ/m [N·m/kg] over a stance: CoP `cop` ahead of the ankle, CoM `ahead` of the hip [m]."""
    reach = body.thigh + body.shank
    omega = np.sqrt(G / (body.ankle + reach + body.above))
    time = np.linspace(-0.5 * STANCE, 0.5 * STANCE, 101)
    x = 0.5 * STEP * np.sinh(omega * time) / np.sinh(0.5 * omega * STANCE)  # from the CoP
    hip = x + cop - ahead  # from the ankle
    if model == "double":
        length = length_at(body.thigh, body.shank, LEAST)
    else:
        loose = {"rigid": RIGID, "spring": RISE}[model]
        length = length_at(body.thigh, body.shank, loose)
    height = np.sqrt(length**2 - hip**2)
    if model == "spring":
        height = np.full_like(hip, length * (1.0 - 1.0 / KAPPA))
    torque = np.empty_like(x)
    for i, (at, z) in enumerate(zip(hip, height, strict=True)):
        flexion = flexion_at(body.thigh, body.shank, float(np.hypot(at, z)))
        if model == "double":
            flexion = max(free_flexion(body.thigh, body.shank, at, z, cop), LEAST)
            z = np.sqrt(max(length_at(body.thigh, body.shank, flexion) ** 2 - at**2, 0.0))
        torque[i] = borne(body, flexion, at, z, cop, x[i])
    return torque


def borne(body: Plane, flexion: float, hip: float, z: float, cop: float, before: float) -> float:
    """τ/m of a leg with its hip at (`hip`, `z`) from the ankle, the CoM `before` the CoP [m]."""
    theta, _ = rod_angles(body.thigh, body.shank, flexion, hip, z)
    knee = body.shank * np.sin(theta), body.shank * np.cos(theta) + body.ankle
    com = z + body.ankle + body.above
    return float(G * ((knee[0] - cop) - before * knee[1] / com))


def least_torque(body: Plane, model: str) -> tuple[float, float, float]:
    """The least mean |τ|/m [N·m/kg], with the CoP and the lean that have it [m]."""
    found = [
        (float(np.abs(knee_torque(body, model, p, o)).mean()), float(p), float(o))
        for p in np.linspace(*body.cop, 31)
        for o in np.linspace(0.0, body.lean, 7)
    ]
    return min(found)


def flat_soles(body: Plane, step: float, speed: float) -> tuple[float, float, float]:
    """The leg ahead when the foot behind leaves: its flexion and the largest that frees its knee
    with a CoP of `body` [rad], and the least |τ|/m [N·m/kg] over CoP and lean."""
    behind, ahead = 0.5 * (step + speed * BOTH), -0.5 * (step - speed * BOTH)
    z = float(np.sqrt(length_at(body.thigh, body.shank, STRAIGHT) ** 2 - behind**2))
    flexion = flexion_at(body.thigh, body.shank, float(np.hypot(ahead, z)))
    cops = np.linspace(*body.cop, 61)
    free = max(free_flexion(body.thigh, body.shank, ahead, z, p) for p in cops)
    least = min(abs(borne(body, flexion, ahead, z, p, ahead + o - p))
                for p in cops for o in np.linspace(0.0, body.lean, 7))  # fmt: skip
    return flexion, free, least


def swing_torque(robot: Robot, body: Plane, time: float) -> float:
    """Mean |L̇|/m [N·m/kg] of a straight leg that swings in `time` [s] at 0.5 m/s."""
    model, legs = robot.model, leg_arrays(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    joint = int(model.dof_jntid[legs.hip_dof[0]])
    hip, com = data.xanchor[joint], model.body_mass @ data.xipos / robot.mass
    inertia = 0.0
    for body_id in range(1, model.nbody):
        if _carried(model, body_id, int(model.jnt_bodyid[joint])):
            way = data.xipos[body_id] - hip
            axes = data.ximat[body_id].reshape(3, 3)
            own = (axes @ np.diag(model.body_inertia[body_id]) @ axes.T)[1, 1]
            below = com[2] - data.xipos[body_id][2]
            inertia += own + model.body_mass[body_id] * -way[2] * below
    height, speed = body.thigh + body.shank, 0.5
    step = speed * (time + 0.07)  # 0.07 s on both feet
    rate = 4.0 * (step / time + speed) / (height * time)
    return float(inertia * rate / robot.mass)


def _carried(model: mujoco.MjModel, body: int, by: int) -> bool:
    """Whether a body is `by`, or below it in the tree."""
    while body and body != by:
        body = int(model.body_parentid[body])
    return body == by


def main() -> None:
    print("| robot | model | CoP in mid-sole, upright | least | its CoP; lean ahead [m] "
          "| 1 cm of CoP | a swing of 0.36; 0.46 s |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in ("humanoid", "human"):
        body = plane_of(load_robot(name))
        middle = 0.5 * (body.cop[0] + body.cop[1])
        swing, slow = (swing_torque(load_robot(name), body, time) for time in (STANCE, 0.46))
        for model in ("rigid", "spring", "double"):
            plain = float(np.abs(knee_torque(body, model, middle, 0.0)).mean())
            least, cop, ahead = least_torque(body, model)
            moved = np.abs(knee_torque(body, model, cop + 0.01, ahead)).mean() - least
            print(f"| {name} | {model} | {plain:.2f} | {least:.2f} | {cop:.3f}; {ahead:.3f} "
                  f"| {moved:+.3f} | {swing:.2f}; {slow:.2f} |")  # fmt: skip
    print("\n| robot | step [m] | v [m/s] | leg ahead bent by [°] | free at most [°] | least |\n"
          "| --- | --- | --- | --- | --- | --- |")  # fmt: skip
    for name in ("humanoid", "human"):
        body = plane_of(load_robot(name))
        for step, speed in STEPS:
            flexion, free, least = flat_soles(body, step, speed)
            print(f"| {name} | {step:g} | {speed:g} | {np.degrees(flexion):.0f} "
                  f"| {np.degrees(free):.0f} | {least:.2f} |")  # fmt: skip


if __name__ == "__main__":
    main()
