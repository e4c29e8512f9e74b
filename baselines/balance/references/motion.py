"""Reference motions by name or file; from keyframes by role.

A motion names no joint of any robot. Its keyframes move *roles* such as `knees`, which each
robot's description maps to its own joints (`roles:` in configs/robots/*.yaml).
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import BSpline, PPoly

from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged_folder, resolve
from poise.configs.schema import build, read_yaml
from poise.envs.compiled.maths.interpolation import MOST_OF_POLYNOMIAL, curve_through
from poise.envs.robots.description import match_names
from poise.envs.robots.robot import Robot

from .foot_steps import FootStep, check_steps, plan_steps
from .footwork import perform_plan
from .postures import LevelKinematics, most_beyond
from .reference_motion import ReferenceMotion
from .robot_clip import RATE, About, RobotClip, read_robot_clip, reference_from, stepped_reference
from .splines import piecewise, rest_spline

SAMPLING = 0.02  # [s] between the postures whose height and root orientation are computed
BALANCE_TOLERANCE = 1e-6  # [m]
Interpolation = Literal["rest", "linear", "hermite", "catmull-rom", "cubic", "polynomial"]


@dataclass(frozen=True)
class Keyframe:
    """A posture at a time; what is left out is as in the standing posture."""

    time: float = field(metadata={"min": 0.0})  # [s]
    roles: dict[str, float] = field(default_factory=dict)  # role → offset from standing [deg]
    com: tuple[float, float] = (0.0, 0.0)  # offset forward, left, in `com_unit`
    rates: dict[str, float] = field(default_factory=dict)  # role → [deg/s], for `hermite`


@dataclass(frozen=True)
class Balance:
    """Roles that keep the CoM over its place: role → fraction of the angle that is solved for."""

    forward: dict[str, float] = field(default_factory=dict)
    left: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class MotionDescription:
    """A motion as data, for any robot that has its roles; configs/motions/*.yaml.

    Between the keyframes angles and CoM go as `interpolation` says: `rest` is C² and at rest at
    both ends, the others are in `clips.interpolation`. With `loop` the motion repeats for ever,
    which needs a last keyframe equal to the first; without, the last keyframe is held.
    `com_unit` fraction: of the half size of the box around the soles, forward and left.

    With `steps` feet leave the ground. Then the CoM is where the soles on it can bear it, the legs
    are those that reach, and what keyframes say of legs is a first guess.
    """

    keyframes: tuple[Keyframe, ...]
    loop: bool = False
    com_unit: Literal["fraction", "m"] = "fraction"
    balance: Balance = field(default_factory=Balance)
    interpolation: Interpolation = "rest"
    steps: tuple[FootStep, ...] = ()

    def __post_init__(self):
        times = [key.time for key in self.keyframes]
        if not times or times[0] != 0.0:
            raise ValueError("keyframes: the first must be at time 0")
        if any(b - a < 0.05 for a, b in pairwise(times)):
            raise ValueError(f"keyframes: times must increase by at least 0.05 s, not {times}")
        first, last = self.keyframes[0], self.keyframes[-1]
        if self.loop and replace(first, time=0.0) != replace(last, time=0.0):
            raise ValueError("keyframes: the last of a loop must be equal to the first")
        if self.interpolation != "hermite" and any(key.rates for key in self.keyframes):
            raise ValueError("keyframes: rates are for the interpolation hermite only")
        if not self.loop and (first.rates or last.rates):
            raise ValueError("keyframes: the first and the last are held and have no rates")
        if self.interpolation == "polynomial" and len(times) > MOST_OF_POLYNOMIAL:
            raise ValueError(f"keyframes: a polynomial goes through at most {MOST_OF_POLYNOMIAL}")
        if self.steps:
            check_steps(self.steps, times[-1])
            moved = any(any(key.com) for key in self.keyframes)
            if self.loop or moved or self.balance != Balance():
                raise ValueError("steps: not with loop, balance, or a com of keyframes: the centre "
                                 "of mass goes where the soles can bear it")  # fmt: skip


def load_motion(motion: str | Path | ReferenceMotion, robot: Robot) -> ReferenceMotion:
    """A packaged motion (`squat`), that of a .yaml file or of a robot's .npz file, or `motion`.

    Raises ConfigError naming file and field: no such motion, a role that the robot lacks, a
    posture out of a joint's range, a CoM outside the soles, a balance that cannot be found; or a
    motion of a robot with other joints. A .npz file is one of `poise motion import`.
    """
    if isinstance(motion, ReferenceMotion):
        if motion.coeffs.shape[2] != len(robot.joint_names) + 6:
            raise ConfigError(f"{motion.name!r} is not a motion of {robot.name!r}", field="motion")
        return motion
    if isinstance(motion, (str, Path)) and Path(motion).suffix == ".npz":
        return reference_from(read_robot_clip(motion), robot, str(motion))
    path = resolve("motions", motion)
    description = build(MotionDescription, read_yaml(path), str(path))
    return make_motion(description, robot, path.stem, str(path))


def make_motion(
    description: MotionDescription, robot: Robot, name: str, source: str
) -> ReferenceMotion:
    """The motion of a description for one robot; errors as in `load_motion`."""
    kinematics = LevelKinematics(robot)
    times, joints, com_xy = _key_curves(description, robot, kinematics, source)
    if description.steps:
        qpos, planted = _stepped(description, joints, robot, source)
        return stepped_reference(name, robot, qpos, RATE, planted, source)

    # height and root orientation follow from the joints
    dense = np.linspace(times[0], times[-1], 1 + int(np.ceil(times[-1] / SAMPLING)))
    level = [kinematics.posture(q) for q in joints(dense)]
    height = rest_spline(dense, np.array([posture.com[2:] for posture in level]))
    root = rest_spline(dense, np.array([kinematics.root_rotation(p) for p in level]))
    _check_range(dense, joints(dense), robot, source)

    knots, coeffs = piecewise([joints, com_xy, height, root])
    return ReferenceMotion(name, knots, coeffs, description.loop)


def load_steps(motion: str | Path, robot: Robot) -> RobotClip:
    """The frames of a packaged motion with steps (`kick`), or of such a .yaml file.

    Raises ConfigError as `load_motion`, and for a motion without steps.
    """
    path = resolve("motions", motion)
    description = build(MotionDescription, read_yaml(path), str(path))
    if not description.steps:
        raise ConfigError("has no steps: of keyframes only motions with steps become clips",
                          source=path, field="steps")  # fmt: skip
    _, joints, _ = _key_curves(description, robot, LevelKinematics(robot), str(path))
    qpos, planted = _stepped(description, joints, robot, str(path))
    return RobotClip(About(robot.name, robot.fingerprint, path.stem), RATE, qpos, planted)


def motions_with_steps() -> list[str]:
    """Names of the packaged motions whose feet leave the ground."""
    return sorted(path.stem for path in packaged_folder("motions").glob("*.yaml")
                  if "steps" in read_yaml(path))  # fmt: skip


def _stepped(
    description: MotionDescription, joints: BSpline | PPoly, robot: Robot, source: str
) -> tuple[np.ndarray, np.ndarray]:
    """Postures (F, nq), `RATE` apart, and the planted soles (F, 2)."""
    frames = joints(np.arange(0.0, description.keyframes[-1].time + 0.5 * RATE, RATE))
    plan = plan_steps(description.steps, frames, np.zeros((len(frames), 3)), robot, source)
    return perform_plan(robot, plan, source), plan.planted


def _key_curves(
    description: MotionDescription, robot: Robot, kinematics: LevelKinematics, source: str
) -> tuple[np.ndarray, BSpline | PPoly, BSpline | PPoly]:
    """Times (n,) of the keyframes [s], and the curves of joints and CoM through them."""
    com = np.array([key.com for key in description.keyframes])
    extent = kinematics.support_extent()
    if description.com_unit == "fraction":
        com = com * extent
    for i, offset in enumerate(com):
        if np.any(np.abs(offset) >= extent):
            raise ConfigError(
                f"{offset.round(3)} m is not inside the soles, which reach ±{extent.round(3)} m",
                source=source,
                field=f"keyframes[{i}].com",
            )
    postures = np.array([_posture(key.roles, robot, source) for key in description.keyframes])
    for i, offset in enumerate(com):
        postures[i] = _balanced(postures[i], offset, description.balance, robot, kinematics, source)

    times = np.array([key.time for key in description.keyframes])
    if len(times) == 1:  # a posture that is held
        times, postures, com = np.array([0.0, 1.0]), postures[[0, 0]], com[[0, 0]]
    standing = robot.standing_qpos[7:]
    keys = description.keyframes
    rates = [_posture(key.rates, robot, source, "rates") - standing for key in keys]
    kind = description.interpolation
    if kind == "rest":
        return times, rest_spline(times, postures), rest_spline(times, com)
    given = np.array(rates) if kind == "hermite" and len(rates) == len(times) else None
    return times, curve_through(kind, times, postures, given), curve_through(kind, times, com)


def _posture(
    roles: dict[str, float], robot: Robot, source: str, field: str = "roles"
) -> np.ndarray:
    """(nj,) standing posture plus the roles' offsets [deg]."""
    q = robot.standing_qpos[7:].copy()
    names = list(robot.joint_names)
    known = robot.description.roles
    for role, degrees in roles.items():
        if role not in known:
            raise ConfigError(
                f"robot {robot.name!r} has no role {shown(role)}",
                source=source,
                field=field,
                choices=known,
            )
        scales = match_names(known[role], names, robot.name, f"roles.{role}")
        for joint, scale in scales.items():
            q[names.index(joint)] += scale * np.radians(degrees)
    return q


def _balanced(
    q: np.ndarray,
    com: np.ndarray,
    balance: Balance,
    robot: Robot,
    kinematics: LevelKinematics,
    source: str,
) -> np.ndarray:
    """`q` with the balance roles turned until the CoM is `com` (2,) from where it is standing."""
    given = [(axis, roles) for axis, roles in enumerate((balance.forward, balance.left)) if roles]
    active = [axis for axis, _ in given]
    standing = robot.standing_qpos[7:]
    turns = np.array([_posture(roles, robot, source) - standing for _, roles in given])

    def error(q: np.ndarray) -> np.ndarray:
        moved = kinematics.posture(q).com[:2] - kinematics.standing.com[:2]
        return (moved - com)[active]

    step = 1e-3  # [deg]
    for _ in range(20):
        now = error(q)
        if np.abs(now).max(initial=0.0) < BALANCE_TOLERANCE:
            return q
        jacobian = np.column_stack([(error(q + step * turn) - now) / step for turn in turns])
        q = q - np.linalg.lstsq(jacobian, now, rcond=None)[0] @ turns
    raise ConfigError(
        f"these roles cannot bring the centre of mass to {com} m", source=source, field="balance"
    )


def _check_range(times: np.ndarray, postures: np.ndarray, robot: Robot, source: str) -> None:
    i, j, beyond = most_beyond(robot, postures)
    if beyond > 1e-9:
        low, high = robot.joint_range[j]
        raise ConfigError(
            f"joint {robot.joint_names[j]!r} would be at {postures[i, j]:.3f} at {times[i]:.2f} s, "
            f"outside its range [{low:.3f}, {high:.3f}]",
            source=source,
            field="keyframes",
        )
