"""Clips for a robot to be put together from, and the robot's motion of what they became."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from poise.baselines.balance.references.foot_steps import plan_of
from poise.baselines.balance.references.footing import root_turns
from poise.baselines.balance.references.footwork import perform_plan
from poise.baselines.balance.references.motion import load_steps, motions_with_steps
from poise.baselines.balance.references.robot_clip import (
    About,
    RobotClip,
    check_clip_robot,
    read_robot_clip,
    reference_from,
)
from poise.baselines.balance.references.stances import (
    at_rest,
    carried,
    home_frames,
    home_place,
    place_of,
)
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.support import Support
from poise.baselines.motion.graphs.joining.coefficient import best_duration, moved_shares
from poise.baselines.motion.graphs.joining.joins import ends, insert
from poise.configs.errors import ConfigError
from poise.configs.extras import needing
from poise.configs.files import packaged_folder
from poise.configs.reading import MIB, read_bytes
from poise.envs.robots.robot import Robot

from .limbs import find_limbs
from .retarget import retarget
from .robot_bvh import clip_of_robot, robot_qpos

MOST_BYTES = 64 * MIB
STILL = 1e-3  # [rad] from standing: nearer needs no lead
TIME_PRICE = 5.0  # of a lead's second
MOST_TURN = 150  # [°] of a motion with steps, whose turns are vectors


def load_clip(file: str | Path, robot: Robot | None = None) -> tuple[Clip, str]:
    """A clip and the SHA-256 of its file: of a .bvh file, a packaged clip, a robot's .npz, or a
    motion of keyframes with steps, by its name or as .yaml.

    With a robot the clip is of the robot's skeleton: a .bvh file is retargeted first. A clip with
    steps knows its contacts.

    Raises:
        ConfigError: no such file; a robot's motion without its robot; as `read_bvh`, `load_steps`
            and `retarget`.
    """
    path = _file(file)
    digest = f"sha256:{hashlib.sha256(read_bytes(path, MOST_BYTES)).hexdigest()[:16]}"
    if path.suffix in (".npz", ".yaml"):
        if robot is None:
            raise ConfigError("is a robot's motion: say which robot's (--robot)", source=path)
        made = _stored(path, robot) if path.suffix == ".npz" else load_steps(path, robot)
        return clip_with_support(made, robot, path.stem), digest
    clip = read_bvh(path).clip
    if robot is None:
        return clip, digest
    return clip_with_support(retarget(clip, robot).clip, robot, path.stem), digest


def clip_with_support(made: RobotClip, robot: Robot, name: str) -> Clip:
    """Return a robot's motion as a clip, with contacts if it has steps."""
    whole = clip_of_robot(robot, made.qpos, made.dt, name)
    support = None
    if made.planted is not None:
        support = Support(made.planted, home_frames(robot, made.qpos, made.planted))
    return replace(whole, licence=made.about.licence, support=support)


def planted_qpos(clip: Clip, robot: Robot) -> np.ndarray:
    """(F, nq) the postures of a clip of the robot's skeleton, on planted soles.

    Raises ConfigError for a clip of another skeleton, PoiseError for a posture to which none with
    planted soles is near.
    """
    with needing("motion", "motion"):
        from .solve import plant
    return plant(robot, find_limbs(robot), robot_qpos(clip, robot))


def robot_clip_of(clip: Clip, robot: Robot, name: str, source: str = "") -> RobotClip:
    """A clip of the robot's skeleton as its motion: from standing to standing, on planted soles.

    Swings of a clip with steps are kept; see `at_rest` for the other soles.

    Raises:
        ConfigError: a clip of another skeleton, or a posture that the robot cannot follow.
        PoiseError: a posture to which none with planted soles is near.
    """
    whole = _led(clip, robot)
    about = About(robot.name, robot.fingerprint, name, source or clip.name, clip.licence)
    if whole.support is None:
        qpos = planted_qpos(whole, robot)
        qpos[0], qpos[-1] = robot.standing_qpos, robot.standing_qpos
        made = RobotClip(about, whole.dt, qpos)
    else:
        qpos, planted = _stepped_qpos(whole, robot, name), whole.support.planted
        made = RobotClip(about, whole.dt, qpos, planted)
    reference_from(made, robot, name)  # nothing is given that cannot be followed
    return made


def _file(name: str | Path) -> Path:
    """The file of a clip, by its own name or that of what is packaged."""
    if str(name) in motions_with_steps():
        return packaged_folder("motions") / f"{name}.yaml"
    return Path(name) if Path(name).suffix in (".npz", ".yaml") else find_bvh(name)


def _stored(path: Path, robot: Robot) -> RobotClip:
    stored = read_robot_clip(path)
    check_clip_robot(stored, robot, str(path))
    jumps = stored.planted is not None and not stored.planted.any(axis=1).all()
    if stored.free or jumps:
        raise ConfigError("jumps, or is walked by a planner: it cannot be joined", source=path,
                          field="motion")  # fmt: skip
    return stored


def _stepped_qpos(clip: Clip, robot: Robot, name: str) -> np.ndarray:
    """(F, nq) the postures of a clip with steps, from where the robot stands to where it ends."""
    assert clip.support is not None
    qpos, home = robot_qpos(clip, robot), home_place(robot)
    qpos = carried(qpos, place_of(robot, qpos[0]), home)
    turned = np.degrees(np.abs(root_turns(robot, qpos)[:, 2]).max())
    if turned > MOST_TURN:
        raise ConfigError(f"turns by {turned:.0f}°: a motion with steps may turn by {MOST_TURN}°",
                          source=name, field="heading")  # fmt: skip
    qpos = at_rest(robot, qpos, clip.support.planted)
    qpos[0] = robot.standing_qpos
    qpos[-1:] = carried(robot.standing_qpos[None], home, place_of(robot, qpos[-1]))
    return qpos


def planned_again(clip: Clip, robot: Robot) -> Clip:
    """A clip with steps whose CoM and legs are those that its trunk, arms and feet ask for now.

    Raises ConfigError as `perform_plan`.
    """
    assert clip.support is not None
    qpos = robot_qpos(clip, robot)
    plan = plan_of(robot, qpos, clip.dt, clip.support.planted)
    made = clip_of_robot(robot, perform_plan(robot, plan, clip.name), clip.dt, clip.name)
    return replace(clip, root=made.root, rotations=made.rotations)


def _led(clip: Clip, robot: Robot) -> Clip:
    """The clip with a way from standing before it and one back behind it, where it needs them."""
    standing = np.repeat(robot.standing_qpos[None], 3, axis=0)
    rest = clip_of_robot(robot, standing, clip.dt, "standing")
    for first in (True, False):
        qpos = robot_qpos(clip, robot)
        if np.abs(qpos[0 if first else -1, 7:] - robot.standing_qpos[7:]).max() > STILL:
            if clip.support is not None:
                raise ConfigError(f"does not {'begin' if first else 'end'} standing", field="steps",
                                  source=clip.name)  # fmt: skip
            pair = (rest, clip) if first else (clip, rest)
            gap, before, after = ends(*pair)
            duration = best_duration(gap, before, after, moved_shares(clip.skeleton), 0.5,
                                     time_price=TIME_PRICE).duration  # fmt: skip
            clip = replace(insert(*pair, duration), name=clip.name, licence=clip.licence)
    return clip
