"""A robot's postures as frames: a file of them, and the reference motion that they make."""

import io
import json
import zipfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

from poise.configs.archives import read_archive, read_arrays
from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import parse_json, parsing
from poise.configs.schema import build
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose

from .footfalls import footfalls
from .footing import check_planted, make_footing, sole_poses
from .postures import LevelKinematics, most_beyond
from .reference_motion import ReferenceMotion, WalkCommand, check_commands, whole_walk
from .splines import piecewise, rest_spline

RATE = 1.0 / 30.0  # [s] between the postures of the clips that are made here
FEWEST = 4  # frames that a spline at rest at both ends takes
LARGEST, UNIT = 1e4, 0.1  # [m, rad] of an entry; by which a quaternion may be off the norm 1
MOST = 20_000
LEVEL = 0.02  # [m] by which a sole may leave the plane of both
ABOUT, PLANTED, COMMANDS = "about.json", "planted", "commands"
RARE = ("unperformed", "free_arms")  # of what a file says of itself


@dataclass(frozen=True)
class About:
    """What a file of a robot's postures says of itself.

    Attributes:
        robot: its name; fingerprint: of its model.
        name: of the motion; source: of which file; licence: of that.
        unperformed: why no controller can perform it, so that it can only be seen; empty: one may.
        free_arms: whether trunk and arms balance the robot, where a planner walks.
    """

    robot: str
    fingerprint: str
    name: str
    source: str = ""
    licence: str = ""
    unperformed: str = ""
    free_arms: bool = False


@dataclass(frozen=True, eq=False)
class RobotClip:
    """Postures of one robot at one rate.

    Attributes:
        about: which robot's, and where they come from.
        dt: time between frames [s].
        qpos: (F, nq) as MuJoCo has them.
        planted: (F, 2) bool, which soles are on the ground; None: both, always.
            One that is `free` may have flight.
        commands: (n, 5) by which a planner walks as the postures do, from their first frame on, see
            `commanded.py`; None: soles go where the postures have them.
    """

    about: About
    dt: float
    qpos: np.ndarray
    planted: np.ndarray | None = None
    commands: np.ndarray | None = None

    @property
    def free(self) -> bool:
        """Whether no controller follows the postures themselves."""
        return bool(self.about.unperformed) or self.commands is not None

    @property
    def duration(self) -> float:
        """Time of the last frame [s]."""
        return (len(self.qpos) - 1) * self.dt


def write_robot_clip(clip: RobotClip, path: str | Path) -> None:
    """Write a ``.npz`` file; the same clip gives the same bytes.

    Raises:
        ConfigError: the name does not end in ``.npz``.
        PoiseError: the file cannot be written.
    """
    if Path(path).suffix != ".npz":
        raise ConfigError("must be the name of a .npz file", source=path, choices=("*.npz",))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        arrays = {"qpos": clip.qpos, "dt": np.array([clip.dt])}
        if clip.planted is not None:
            arrays[PLANTED] = clip.planted.astype(float)
        if clip.commands is not None:
            arrays[COMMANDS] = clip.commands
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), version=(1, 0))
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), member.getvalue())
        said = {k: v for k, v in asdict(clip.about).items() if v or k not in RARE}
        about = json.dumps(said, ensure_ascii=False, indent=1)
        archive.writestr(zipfile.ZipInfo(ABOUT), about)
    write_atomic(path, content.getvalue())


def read_robot_clip(path: str | Path) -> RobotClip:
    """The postures in a file of `write_robot_clip`.

    Raises:
        ConfigError: no such file, or one that does not hold such postures.
    """
    archive = read_archive(path)
    further = [name for name in (COMMANDS, PLANTED) if f"{name}.npy" in archive.names]
    arrays = read_arrays(path, ("qpos", "dt", *further))
    with parsing(path):
        about = parse_json(archive.read(ABOUT))
    if not isinstance(about, dict):
        raise ConfigError("must be a mapping", source=path, field=ABOUT)
    clip = RobotClip(build(About, about, f"{path}: {ABOUT}"), float(arrays["dt"].sum()),
                     arrays["qpos"])  # fmt: skip
    if clip.qpos.ndim != 2 or not FEWEST <= len(clip.qpos) <= MOST or clip.qpos.shape[1] < 8:
        raise ConfigError(f"must be {FEWEST} to {MOST} postures, not {clip.qpos.shape}",
                          source=path, field="qpos")  # fmt: skip
    if arrays["dt"].shape != (1,) or not 1e-3 <= clip.dt <= 1.0:
        raise ConfigError("must be one time from 0.001 to 1 s", source=path, field="dt")
    if not (np.abs(clip.qpos) <= LARGEST).all():
        raise ConfigError(f"must be finite and at most {LARGEST:g}", source=path, field="qpos")
    norms = np.linalg.norm(clip.qpos[:, 3:7], axis=1)
    if np.any(off := np.abs(norms - 1.0) > UNIT):
        frame = int(np.argmax(off))
        raise ConfigError(f"the root's quaternion of frame {frame} has the norm "
                          f"{norms[frame]:.3g}, not 1", source=path, field="qpos")  # fmt: skip
    if COMMANDS in arrays:
        check_commands(arrays[COMMANDS], str(path))
        clip = replace(clip, commands=arrays[COMMANDS])
    if PLANTED in arrays:
        planted = arrays[PLANTED]
        if planted.shape != (len(clip.qpos), 2) or not np.isin(planted, (0.0, 1.0)).all():
            raise ConfigError(
                f"must be {len(clip.qpos)} rows of two numbers, 1 where a sole is planted, else 0",
                source=path, field=PLANTED,
            )  # fmt: skip
        planted = np.asarray(planted > 0.0)
        if not clip.free:
            check_planted(planted, str(path))
        clip = replace(clip, planted=planted)
    return clip


def reference_from(
    clip: RobotClip, robot: Robot, source: str, rest: bool = True
) -> ReferenceMotion:
    """The reference motion of the postures: C², and at rest at both ends.

    Joints, CoM and root are cubic splines through the frames. With commands these are of trunk and
    arms, from standing to standing. The places of the soles are where
    they are: CoM and root are taken over the plane and the middle of both, see `LevelKinematics`.
    Without `rest` it is a piece of a motion: at its ends it moves on as its frames do.

    Raises:
        ConfigError: postures of another robot, or such as can only be seen; a joint out of its
            range, or soles that leave their plane by 2 cm though they are planted.
    """
    check_clip_robot(clip, robot, source)
    if clip.about.unperformed:
        raise ConfigError(f"can be seen, but not performed: {clip.about.unperformed}",
                          source=source, field="motion")  # fmt: skip
    joints, dt, commands, walked = clip.qpos[:, 7:], clip.dt, clip.commands, None
    if commands is not None:
        joints, commands = whole_walk(robot, clip.qpos, dt, commands)
        if clip.planted is not None:
            _, places, turns = sole_poses(robot, clip.qpos)
            at = WalkCommand(*commands[1]).start + np.arange(len(clip.qpos)) * dt
            walked = footfalls(at, places, turns, clip.planted)
    elif clip.planted is not None:
        return stepped_reference(
            clip.about.name, robot, clip.qpos, clip.dt, clip.planted, source
        )  # fmt: skip
    kinematics, times = LevelKinematics(robot), np.arange(len(joints)) * dt
    _check_range(joints, robot, source)
    com, root = np.empty((len(times), 3)), np.empty((len(times), 3))
    for i, q in enumerate(joints):
        posture = kinematics.posture(q)
        _check_level(kinematics, times[i], source)
        com[i] = posture.com - kinematics.standing.com * [1.0, 1.0, 0.0]  # controllers add that
        root[i] = kinematics.root_rotation(posture)
    spline = rest_spline if rest else make_interp_spline  # the latter without a knot near ends
    splines = [spline(times, values) for values in (joints, com, root)]
    knots, coeffs = piecewise(splines)
    return ReferenceMotion(clip.about.name, knots, coeffs, False, None, commands, walked,
                           clip.about.free_arms)  # fmt: skip


def check_clip_robot(clip: RobotClip, robot: Robot, source: str) -> None:
    """Raise ConfigError unless the postures are of this robot."""
    its, other = clip.about.robot, robot.name
    if clip.about.fingerprint != robot.fingerprint:
        hint = f" (--robot {its})" if its != other else " as it is here"
        raise ConfigError(f"is a motion of the robot {its!r}, not of {other!r}{hint}",
                          source=source, field="motion")  # fmt: skip


def stepped_reference(
    name: str, robot: Robot, qpos: np.ndarray, dt: float, planted: np.ndarray, source: str
) -> ReferenceMotion:
    """The reference motion of postures (F, nq) of which some stand on one sole, `planted` (F, 2).

    Joints are cubic splines through the frames. CoM and root are in the motion's own frame, in
    `footing`, and in the table of the motion relative to the middle of the soles, as ever.

    Raises:
        ConfigError: a joint out of its range; planted soles that move, see `make_footing`.
    """
    _check_range(qpos[:, 7:], robot, source)
    footing, times = make_footing(robot, qpos, dt, planted, source), np.arange(len(qpos)) * dt
    com, places, _ = sole_poses(robot, qpos)
    standing = LevelKinematics(robot).standing.com * [1.0, 1.0, 0.0]
    turns = np.array([footing.sample(t).root[0] for t in times])
    tables = (qpos[:, 7:], com - places.mean(axis=1) - standing, turns)
    knots, coeffs = piecewise([rest_spline(times, values) for values in tables])
    return ReferenceMotion(name, knots, coeffs, False, footing)


def _check_range(joints: np.ndarray, robot: Robot, source: str) -> None:
    frame, joint, beyond = most_beyond(robot, joints)
    if beyond > 1e-6:
        raise ConfigError(
            f"joint {robot.joint_names[joint]!r} is {beyond:.3g} beyond its range "
            f"in frame {frame}", source=source, field="qpos",
        )  # fmt: skip


def _check_level(kinematics: LevelKinematics, time: float, source: str) -> None:
    """Raise ConfigError if the soles of the last posture are not level with each other."""
    soles = [sole_pose(kinematics.data, sole) for sole in kinematics.robot.soles]
    (first, first_axes), (second, second_axes) = soles
    gap = abs(float((second - first) @ (first_axes + second_axes)[:, 2] / 2.0))
    if gap > LEVEL:
        raise ConfigError(
            f"at {time:.2f} s one sole is {100 * gap:.1f} cm above the other: both must stay on "
            "the ground", source=source, field="qpos",
        )  # fmt: skip
