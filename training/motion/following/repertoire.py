"""The motions of a suite: put on the robot once, the same for all of its trials."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import (
    RobotClip,
    read_robot_clip,
    reference_from,
)
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh, known_clips
from poise.baselines.motion.retargeting.retarget import retarget
from poise.configs.files import resolve
from poise.configs.reading import is_file
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.trials.repertoire import Repertoire, kept

STANDING = "standing"


def is_clip(name: str) -> bool:
    """Return True for what is a robot's postures, or becomes that; false for keyframes."""
    return name in known_clips() or Path(name).suffix.lower() in (".npz", ".bvh")


def load_repertoire(
    names: Sequence[str], labels: Sequence[str], robot: Robot, folder: Path, fresh: bool = False
) -> Repertoire:
    """Return the motions of these `names`, called `labels`.

    A packaged clip is retargeted to the robot, which takes about a second, unless `folder` has
    kept it; with `fresh` it is retargeted again. So is a ``.bvh`` file. A ``.npz`` file is the
    motion itself.

    Raises:
        ConfigError: no such motion, one of another robot, one that cannot be followed; a clip
            without the packages that it takes.
    """
    durations, digests = {STANDING: load_motion(STANDING, robot).duration}, {}
    clips: dict[str, RobotClip] = {}
    for name, label in zip(names, labels, strict=True):
        if is_clip(name):
            clips[label] = clip = _clip(name, robot, kept(folder, label), fresh)
            durations[label] = reference_from(clip, robot, name).duration
            content = [f"{clip.dt!r} {clip.qpos.shape}".encode(), clip.qpos.tobytes()]
        else:
            durations[label] = load_motion(name, robot).duration
            content = [resolve("motions", name).read_bytes()]
        digests[label] = hashlib.sha256(b"\0".join(content)).hexdigest()
    return Repertoire(durations, digests, clips)


def _clip(name: str, robot: Robot, stored: Path, fresh: bool) -> RobotClip:
    """Return the robot's postures of a packaged clip, a .bvh or a .npz file."""
    if Path(name).suffix == ".npz":
        return read_robot_clip(name)
    if name in known_clips() and is_file(stored) and not fresh:
        return read_robot_clip(stored)
    return retarget(read_bvh(find_bvh(name)).clip, robot).clip
