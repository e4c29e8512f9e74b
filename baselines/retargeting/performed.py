"""Clips for a robot to be put together from, and the robot's motion of what they became."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.clips.bvh import read_bvh
from poise.baselines.clips.clip import Clip
from poise.baselines.clips.library import find_bvh
from poise.baselines.joining.coefficient import best_duration, moved_shares
from poise.baselines.joining.joins import ends, insert
from poise.baselines.motions.robot_clip import (
    About,
    RobotClip,
    check_both_planted,
    read_robot_clip,
    reference_from,
)
from poise.configs.errors import ConfigError
from poise.configs.reading import MIB, read_bytes
from poise.envs.robots.robot import Robot

from .limbs import find_limbs
from .retarget import retarget
from .robot_bvh import clip_of_robot, robot_qpos

MOST_BYTES = 64 * MIB
STILL = 1e-3  # [rad] from standing: nearer needs no lead
TIME_PRICE = 5.0  # of a lead's second


def load_clip(file: str | Path, robot: Robot | None = None) -> tuple[Clip, str]:
    """A clip and the SHA-256 of its file: of a .bvh file, a packaged clip or a robot's .npz.

    With a robot the clip is of the robot's skeleton: a .bvh file is retargeted first.

    Raises:
        ConfigError: no such file; a .npz without its robot; steps; as `read_bvh` and `retarget`.
    """
    path = Path(file) if Path(file).suffix == ".npz" else find_bvh(file)
    digest = f"sha256:{hashlib.sha256(read_bytes(path, MOST_BYTES)).hexdigest()[:16]}"
    if path.suffix == ".npz":
        return _of_robot(path, robot), digest
    clip = read_bvh(path).clip
    if robot is None:
        return clip, digest
    made = retarget(clip, robot).clip
    check_both_planted(made, path.stem, "what is put together of clips")
    whole = clip_of_robot(robot, made.qpos, made.dt, path.stem)
    return replace(whole, licence=clip.licence), digest


def planted_qpos(clip: Clip, robot: Robot) -> np.ndarray:
    """(F, nq) the postures of a clip of the robot's skeleton, on planted soles.

    Raises ConfigError for a clip of another skeleton, PoiseError for a posture to which none with
    planted soles is near.
    """
    return np.asarray(_plant()(robot, find_limbs(robot), robot_qpos(clip, robot)))


def robot_clip_of(clip: Clip, robot: Robot, name: str, source: str = "") -> RobotClip:
    """A clip of the robot's skeleton as its motion: from standing to standing, on planted soles.

    Raises:
        ConfigError: a clip of another skeleton, or a posture that the robot cannot follow.
        PoiseError: a posture to which none with planted soles is near.
    """
    whole = _led(clip, robot)
    qpos = planted_qpos(whole, robot)
    qpos[0], qpos[-1] = robot.standing_qpos, robot.standing_qpos
    about = About(robot.name, robot.fingerprint, name, source or clip.name, clip.licence)
    made = RobotClip(about, whole.dt, qpos)
    reference_from(made, robot, name)  # nothing is given that cannot be followed
    return made


def _of_robot(path: Path, robot: Robot | None) -> Clip:
    if robot is None:
        raise ConfigError("is a robot's motion: say which robot's (--robot)", source=path)
    stored = read_robot_clip(path)
    if stored.about.fingerprint != robot.fingerprint:
        raise ConfigError(f"is a motion of the robot {stored.about.robot!r}, not of "
                          f"{robot.name!r}", source=path, field="robot")  # fmt: skip
    check_both_planted(stored, path, "what is put together of clips")
    clip = clip_of_robot(robot, stored.qpos, stored.dt, path.stem)
    return replace(clip, licence=stored.about.licence)


def _led(clip: Clip, robot: Robot) -> Clip:
    """The clip with a way from standing before it and one back behind it, where it needs them."""
    standing = np.repeat(robot.standing_qpos[None], 3, axis=0)
    rest = clip_of_robot(robot, standing, clip.dt, "standing")
    for first in (True, False):
        qpos = robot_qpos(clip, robot)
        if np.abs(qpos[0 if first else -1, 7:] - robot.standing_qpos[7:]).max() > STILL:
            pair = (rest, clip) if first else (clip, rest)
            gap, before, after = ends(*pair)
            duration = best_duration(gap, before, after, moved_shares(clip.skeleton), 0.5,
                                     time_price=TIME_PRICE).duration  # fmt: skip
            clip = replace(insert(*pair, duration), name=clip.name, licence=clip.licence)
    return clip


def _plant() -> Any:  # the function `plant`
    try:
        from .solve import plant
    except ImportError as error:
        raise ConfigError(f"needs the package {error.name}: pip install 'poise[motion]'",
                          source="motion") from None  # fmt: skip
    return plant
