"""What legs with flat soles can do: `python -m tests.performance.walking_bounds`.

Statics in the sagittal plane. Both soles are flat at the moment when the foot behind leaves the
ground, so its leg, of at most ℓ = |hip − ankle| with the knee at the end of its range, holds the
hip down; and the leg ahead, bent by that, has to bear the robot alone. With the CoP p and the CoM c
the force of the ground points from p to c, and grows by n = F/(m g) until a motor of the leg ahead
is at its limit. n below 1 is a place where the robot sinks whatever it does. c_x − p = −v/ω is
where a pendulum of speed v just gets over p; 0 is standing. The place of the hip is the one with
the largest n.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot, load_robot

G = 9.81
MOST = {"hip": 120.0, "knee": 80.0, "ankle": 20.0}  # [N·m] of the humanoid's motors


@dataclass(frozen=True)
class Body:
    """Lengths [m] and masses [kg] of a robot in the sagittal plane."""

    thigh: float
    shank: float
    ankle: float  # height over the sole
    least_bend: float  # of the knee [rad]
    most_extension: float  # of the hip [rad]
    mass: float
    m_thigh: float
    m_shank: float
    m_foot: float
    upper: tuple[float, float]  # of trunk, arms and head: the CoM from the hips, upright
    sole: tuple[float, float]  # from the ankle back to the heel and on to the toes

    @property
    def reach(self) -> float:
        """The longest leg."""
        return length(self, self.least_bend)

    @property
    def m_upper(self) -> float:
        return self.mass - 2.0 * (self.m_thigh + self.m_shank + self.m_foot)


def body_of(robot: Robot) -> Body:
    """The humanoid's."""
    m, d = robot.model, mujoco.MjData(robot.model)
    d.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(m, d)
    at = {name: d.joint(f"right_{name}").xanchor for name in ("hip_y", "knee", "ankle_y")}
    masses = {b: m.body(f"right_{b}").mass[0] for b in ("thigh", "shin", "foot")}
    legs = [m.body(f"{side}_{b}").id for side in ("right", "left") for b in masses]
    others = [b for b in range(1, m.nbody) if b not in legs]
    com = m.body_mass[others] @ d.xipos[others] / m.body_mass[others].sum()
    sole = robot.soles[0]
    middle = d.xpos[sole.body_id] + d.xmat[sole.body_id].reshape(3, 3) @ sole.position
    corners = sole.polygon[:, 0] + middle[0] - at["ankle_y"][0]
    return Body(
        thigh=float(np.hypot(*(at["hip_y"] - at["knee"])[[0, 2]])),
        shank=float(np.hypot(*(at["knee"] - at["ankle_y"])[[0, 2]])),
        ankle=float(at["ankle_y"][2]),
        least_bend=float(-m.joint("right_knee").range[1]),
        most_extension=float(m.joint("right_hip_y").range[1]),
        mass=robot.mass,
        m_thigh=float(masses["thigh"]),
        m_shank=float(masses["shin"]),
        m_foot=float(masses["foot"]),
        upper=tuple(float(x) for x in (com - at["hip_y"])[[0, 2]]),
        sole=(float(corners.min()), float(corners.max())),
    )


def length(body: Body, bend: float) -> float:
    """ℓ [m] of a leg whose knee is bent by `bend` [rad]."""
    a, b = body.thigh, body.shank
    return float(np.sqrt(a * a + b * b + 2.0 * a * b * np.cos(bend)))


def bend_of(body: Body, ell: float) -> float:
    """The knee's bend [rad] of a leg as long as `ell` [m]."""
    a, b = body.thigh, body.shank
    return float(np.arccos(np.clip((ell * ell - a * a - b * b) / (2.0 * a * b), -1.0, 1.0)))


def knee_of(body: Body, hip: np.ndarray, ankle: np.ndarray) -> np.ndarray:
    """Where the knee is [m], ahead of the line from ankle to hip."""
    way = hip - ankle
    ell = float(np.hypot(*way))
    up = way / ell
    along = (ell * ell + body.shank**2 - body.thigh**2) / (2.0 * ell)
    off = np.sqrt(max(body.shank**2 - along * along, 0.0))
    return ankle + along * up + off * np.array([up[1], -up[0]])


def turned(vector: tuple[float, float], lean: float) -> np.ndarray:
    """A vector of the trunk that leans ahead by `lean` [rad]."""
    x, z = vector
    return np.array([x * np.cos(lean) + z * np.sin(lean), z * np.cos(lean) - x * np.sin(lean)])


@dataclass(frozen=True)
class Support:
    """The robot on the leg ahead alone; the ankle there is at (0, 0)."""

    lift: float  # the largest n = F/(m g)
    by: str  # the motor that limits it
    bend: float  # of the knee [rad]
    ahead: float  # of the CoM before the ankle [m]
    height: float  # of the hip over the ankle [m]


def support(body: Body, hip: np.ndarray, behind: np.ndarray, lean: float, before: float) -> Support:
    """The robot with its hip there and the other ankle `behind` it; `before` is c_x − p [m]."""
    ahead = np.zeros(2)
    knees = [knee_of(body, hip, ankle) for ankle in (ahead, behind)]
    parts = [(body.m_upper, hip + turned(body.upper, lean))]
    for ankle, knee in zip((ahead, behind), knees, strict=True):
        parts += [(body.m_thigh, 0.5 * (hip + knee)), (body.m_shank, 0.5 * (knee + ankle)),
                  (body.m_foot, ankle)]  # fmt: skip
    c = sum(mass * place for mass, place in parts) / body.mass
    p = np.array([c[0] - before, -body.ankle])
    force = (c - p) / (c[1] - p[1]) * body.mass * G
    below = {"ankle": (ahead, [parts[3]]), "knee": (knees[0], parts[2:4]), "hip": (hip, parts[1:4])}
    lifts = {}
    for name, (joint, borne) in below.items():
        r = joint - p
        torque = r[0] * force[1] - r[1] * force[0]
        torque -= sum(mass * G * (joint[0] - place[0]) for mass, place in borne)
        lifts[name] = MOST[name] / max(abs(torque), 1e-9)
    if not body.sole[0] <= p[0] <= body.sole[1]:
        lifts["sole"] = 0.0
    by = min(lifts, key=lambda name: lifts[name])
    return Support(lifts[by], by, bend_of(body, float(np.hypot(*hip))), float(c[0]), float(hip[1]))


def best(body: Body, step: float, rise: float, lean: float, before: float) -> Support:
    """The place of the hip with the largest n when the foot behind, a `step` and a `rise` [m] back,
    leaves."""
    behind, found = np.array([-step, -rise]), None
    for x in np.arange(-step, 0.12, 0.005):
        for z in np.arange(0.30, body.reach, 0.005):
            hip = np.array([x, z])
            way = hip - behind
            ell = float(np.hypot(*way))
            if ell > body.reach or np.hypot(*hip) > body.reach:
                continue
            thigh = hip - knee_of(body, hip, behind)
            if np.arctan2(thigh[0], thigh[1]) - lean > body.most_extension:
                continue
            here = support(body, hip, behind, lean, before)
            if found is None or here.lift > found.lift:
                found = here
    return found or Support(0.0, "reach", np.nan, np.nan, np.nan)


def least_width(robot: Robot) -> float:
    """Between the middles of the soles [m] with both legs turned in as far as hips go, the knees
    as straight as they get, the pelvis level."""
    m, d = robot.model, mujoco.MjData(robot.model)
    d.qpos[:] = robot.standing_qpos
    for side in ("right", "left"):
        for name, angle in (
            ("hip_x", m.joint(f"{side}_hip_x").range[1]),
            ("hip_y", 0.0),
            ("ankle_y", 0.0),
            ("knee", m.joint(f"{side}_knee").range[1]),
        ):
            d.qpos[m.joint(f"{side}_{name}").qposadr[0]] = angle
    mujoco.mj_kinematics(m, d)
    return float(abs(d.body("left_foot").xpos[1] - d.body("right_foot").xpos[1]))


def stairs(body: Body, omega: float) -> None:
    """A table of rises: n where the foot behind leaves."""
    print("| step [m] | rise [m] | lean [°] | v [m/s] | n | by | knee [°] | hip [m] |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for step, rises, speeds in (
        (0.28, (0.10, 0.15, 0.18), (0.0,)),  # to the next tread, both feet on each
        (0.30, (0.05, 0.10, 0.15), (0.0, 0.25, 0.5)),
    ):
        for rise in rises:
            for lean in (0.0, 15.0, 30.0):
                for v in speeds:
                    s = best(body, step, rise, np.radians(lean), -v / omega)
                    print(f"| {step:g} | {rise:g} | {lean:g} | {v:g} | {s.lift:.2f} | {s.by} "
                          f"| {np.degrees(s.bend):.0f} | {s.height:.2f} |", flush=True)  # fmt: skip


def long_steps(body: Body) -> None:
    """A table of steps on level ground: how high the hip may be, and what that asks of the leg
    that bears the robot in the middle of its stance and of the one that swings."""
    print("| step [m] | v [m/s] | both feet [s] | hip at most [m] | knee in mid-stance [°] "
          "| n there | hip of the swing [rad/s] | [N·m] | knee of the swing [rad/s] |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for step, v in ((0.4, 0.8), (0.5, 0.8), (0.6, 0.8), (0.6, 1.0), (0.7, 1.0)):
        for both in (0.04, 0.08):
            behind = 0.5 * (step + v * both)  # of the hip, when the foot leaves
            most = 0.0  # with the knee bent as far as the thigh must be within the hip's range
            for bend in np.arange(body.least_bend, 1.5, 0.005):
                ell = length(body, bend)
                if ell <= behind:
                    break
                hip = np.array([behind, np.sqrt(ell * ell - behind * behind)])
                thigh = hip - knee_of(body, hip, np.zeros(2))
                if np.arctan2(thigh[0], thigh[1]) <= body.most_extension:
                    most = max(most, float(hip[1]))
            found = []  # in the middle of the stance, the hip where it is easiest
            for x in np.arange(-0.1, 0.1, 0.005):
                hip = np.array([x, most])
                ankle = np.array([x, min(0.1, most - 0.2)])  # of the swinging foot, passing
                found.append(support(body, hip, ankle, 0.0, 0.0))
            mid = max(found, key=lambda each: each.lift)
            time = step / v - both
            swing = 2.0 * np.arctan2(behind, most)  # [rad] that the line hip–ankle turns
            fastest = 1.5 * swing / time  # of a cubic from rest to rest
            inertia = (
                body.m_thigh * (0.5 * body.thigh) ** 2
                + body.m_shank * (0.9 * body.thigh) ** 2
                + body.m_foot * body.thigh**2
            )  # of a leg with the shank folded up
            torque = 6.0 * swing / time**2 * inertia
            folded = bend_of(body, most - min(0.1, most - 0.2))
            straight = bend_of(body, float(np.hypot(behind, most)))
            knee = 1.5 * 2.0 * (folded - straight) / time
            print(f"| {step:g} | {v:g} | {both:g} | {most:.3f} | {np.degrees(mid.bend):.0f} "
                  f"| {mid.lift:.2f} ({mid.by}) | {fastest:.1f} | {torque:.0f} "
                  f"| {knee:.1f} |", flush=True)  # fmt: skip


def main() -> None:
    robot = load_robot("humanoid")
    body = body_of(robot)
    print(f"leg {body.reach:.3f} m; feet no closer than {least_width(robot):.3f} m\n")
    long_steps(body)
    print()
    stairs(body, robot.omega)


if __name__ == "__main__":
    main()
