"""Whether a robot can do a motion: the ground, the motors and the joints, sample by sample."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.envs.compiled.maths.polygons import half_planes
from poise.envs.robots.ground import contact_friction
from poise.envs.robots.robot import Robot

from .split import joint_motor_torques
from .stepped import margins, sample_stepped
from .trajectory import Joints, PlantedRobot, Trajectory, joints_of, sample_trajectory

RATE = 100.0  # [Hz] of the samples
LONGEST = 600.0  # [s]
#: unit → how much of it one lacks as badly as of others
SCALES = {"m": 0.1, "": 1.0, "m g": 0.5, "rad/s": 10.0, "rad": 0.1}


@dataclass(frozen=True)
class FeasibilityLimits:
    """What a motion may ask for.

    Attributes:
        zmp_margin: from the ZMP to the edge of the hull of the soles [m], at least.
        friction: of the ground's horizontal force over μ times its vertical one, at most.
        load: vertical force of the ground over the weight, from and to.
        torque: of the motors' limits, at most.
        speed: of a joint [rad/s].
        excess: of a joint over its range between frames [rad].
        drift: of a sole's corner from where it stands [m].
        gap: of the QP's acceleration from the motion's, as a share of the weight.
    """

    zmp_margin: float = 0.01
    friction: float = 0.9
    load: tuple[float, float] = (0.3, 2.0)
    torque: float = 1.0
    speed: float = 20.0
    excess: float = 1e-3
    drift: float = 5e-3
    gap: float = 0.5


class Criterion(NamedTuple):
    """One thing that must hold, and where it is nearest to not holding or furthest from it.

    Attributes:
        name: of what.
        worst, time: the worst value, and when [s].
        bound: that it has to keep; `least` tells whether from above.
        unit: of both.
        where: the joint or motor of the worst value; empty where there is none.
    """

    name: str
    worst: float
    time: float
    bound: float
    least: bool
    unit: str
    where: str = ""

    @property
    def holds(self) -> bool:
        """Whether the worst value keeps the bound."""
        return self.worst >= self.bound if self.least else self.worst <= self.bound

    @property
    def lacking(self) -> float:
        """By how much the bound is missed; below 0 if it is kept."""
        return self.bound - self.worst if self.least else self.worst - self.bound

    def __str__(self) -> str:
        place = f" ({self.where})" if self.where else ""
        word = "at least" if self.least else "at most"
        return (f"{self.name} {shown(self.worst, self.unit)} at {self.time:.2f} s{place}, "
                f"{word} {shown(self.bound, self.unit)} is needed")  # fmt: skip


@dataclass(frozen=True, eq=False)
class Feasibility:
    """A motion against `FeasibilityLimits`, in n samples.

    Attributes:
        limits: that it was held against.
        times: (n,) [s].
        zmp: (n, 2) [m]; support: (k, 2) hull of the soles [m]; zmp_margin: (n,) distance of the
            ZMP to the hull's edge, above 0 inside [m].
        reach: (n, 2, 2) least and largest x and y of the soles that are planted [m].
        friction: (n,) ‖f_t‖/(μ f_z); load: (n,) f_z/(m g).
        torque: (n, nu) |τ|/τ_max with the least wrenches of the soles.
        speed: (n, nj) |q̇| [rad/s]; excess: (n, nj) over the joint's range, below 0 inside [rad].
        drift: (n,) of the soles [m].
        gap: (n,) of the QP; None where it was not asked.
        motors, joints: their names.
    """

    limits: FeasibilityLimits
    times: np.ndarray
    zmp: np.ndarray
    support: np.ndarray
    zmp_margin: np.ndarray
    reach: np.ndarray
    friction: np.ndarray
    load: np.ndarray
    torque: np.ndarray
    speed: np.ndarray
    excess: np.ndarray
    drift: np.ndarray
    gap: np.ndarray | None
    motors: tuple[str, ...]
    joints: tuple[str, ...]

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """Each criterion at its worst sample."""
        c, motors, joints = self.limits, self.motors, self.joints
        rows = [
            self._worst("ZMP inside the soles by", self.zmp_margin, c.zmp_margin, True, "m"),
            self._worst("friction, of what the ground has", self.friction, c.friction, False, ""),
            self._worst("least load", self.load, c.load[0], True, "m g"),
            self._worst("largest load", self.load, c.load[1], False, "m g"),
            self._worst("torque, of the motor's limit", self.torque, c.torque, False, "", motors),
            self._worst("joint speed", self.speed, c.speed, False, "rad/s", joints),
            self._worst("joint beyond its range by", self.excess, c.excess, False, "rad", joints),
            self._worst("a sole off its place by", self.drift, c.drift, False, "m"),
        ]
        if self.gap is not None:
            rows.append(self._worst("gap of the QP", self.gap, c.gap, False, "m g"))
        return tuple(rows)

    @property
    def feasible(self) -> bool:
        """Whether every criterion holds."""
        return all(criterion.holds for criterion in self.criteria)

    @property
    def lacking(self) -> float:
        """Sum of what the criteria lack, each over a unit of its own; 0 if all hold."""
        return float(sum(max(0.0, c.lacking) / SCALES[c.unit] for c in self.criteria))

    @property
    def reason(self) -> str:
        """The first criterion that does not hold, at its worst sample; empty if all do."""
        return next((str(c) for c in self.criteria if not c.holds), "")

    def _worst(
        self, name: str, values: np.ndarray, bound: float, least: bool, unit: str,
        names: tuple[str, ...] = (),
    ) -> Criterion:  # fmt: skip
        k = int(np.argmin(values) if least else np.argmax(values))
        place = np.unravel_index(k, values.shape)
        where = names[place[1]] if names else ""
        worst, time = float(values[place]), float(self.times[place[0]])
        return Criterion(name, worst, time, bound, least, unit, where)


def check_motion(
    motion: ReferenceMotion | RobotClip,
    robot: Robot,
    limits: FeasibilityLimits | None = None,
) -> Feasibility:
    """What a robot needs to do a motion, 100 times a second, against what it has.

    Checked is what controllers are asked for: the C² motion of the joints, at rest at both ends,
    with the soles where they stand. Of a motion with steps only the soles that its schedule has
    planted bear anything. M v̇ + h in the root's rows is the wrench of the ground.

    Raises:
        ConfigError: a clip that is no motion of this robot, see `reference_from`.
    """
    if isinstance(motion, RobotClip):
        motion = reference_from(motion, robot, motion.about.name)
    times = np.arange(0.0, min(motion.duration, LONGEST) + 1e-9, 1.0 / RATE)
    planted = PlantedRobot(robot)
    if motion.footing is not None:
        return judge(robot, sample_stepped(planted, motion, times), limits)
    return check_joints(planted, joints_of(motion), times, limits)


def check_joints(
    planted: PlantedRobot,
    joints: Joints,
    times: np.ndarray,
    limits: FeasibilityLimits | None = None,
) -> Feasibility:
    """The same of a motion of the joints at `times` (n,) [s]."""
    return judge(planted.robot, sample_trajectory(planted, joints, times), limits)


def judge(
    robot: Robot, trajectory: Trajectory, limits: FeasibilityLimits | None = None
) -> Feasibility:
    """A sampled trajectory against limits."""
    force, support = trajectory.wrench[:, :3], trajectory.support
    if trajectory.planted.all():
        normals, offsets = half_planes(support)
        margin = (offsets - trajectory.zmp @ normals.T).min(axis=1)
        drift = np.linalg.norm(trajectory.corners - trajectory.corners[0], axis=2).max(axis=1)
    else:
        margin, drift = margins(robot, trajectory)
    joints = trajectory.qpos[:, 7:]
    excess = np.maximum(robot.joint_range[:, 0] - joints, joints - robot.joint_range[:, 1])
    torque = joint_motor_torques(robot, trajectory) / np.asarray(robot.torque_limit)
    return Feasibility(
        limits=limits or FeasibilityLimits(),
        times=trajectory.times,
        zmp=trajectory.zmp,
        support=support,
        zmp_margin=margin,
        reach=_reach(robot, trajectory),
        friction=np.hypot(force[:, 0], force[:, 1]) / (ground_friction(robot) * force[:, 2]),
        load=force[:, 2] / robot.units.force,
        torque=np.abs(torque),
        speed=np.abs(trajectory.qvel[:, 6:]),
        excess=excess,
        drift=drift,
        gap=None,
        motors=robot.motor_names,
        joints=robot.joint_names,
    )


def _reach(robot: Robot, path: Trajectory) -> np.ndarray:
    """(n, 2, 2) least and largest x and y of the planted soles [m]."""
    corners = path.corners[:, :, :2]
    counts = [len(sole.polygon) for sole in robot.soles]
    down = path.planted[:, np.repeat(np.arange(len(counts)), counts)]
    low, high = (np.where(down[..., None], corners, away) for away in (np.inf, -np.inf))
    return np.stack([low.min(axis=1), high.max(axis=1)], axis=1)


def ground_friction(robot: Robot) -> float:
    """μ, the least of the soles on the ground."""
    geoms = [geom for sole in robot.soles for geom in sole.geom_ids]
    return contact_friction(robot.model, robot.ground_geom_id, geoms)


def shown(value: float, unit: str) -> str:
    """A value as a person reads it: lengths in cm, angles in degrees."""
    if unit == "m":
        return f"{100 * value:.1f} cm"
    if unit == "rad":
        return f"{np.degrees(value):.2f}°"
    return f"{value:.2f} {unit}".rstrip()
