"""The clips that scripts are made of, ready to be put together, and what becomes of a script."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from poise.baselines.balance.references.motion import motions_with_steps
from poise.baselines.balance.references.robot_clip import write_robot_clip
from poise.baselines.motion.clips.bvh import write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import packaged_clips
from poise.baselines.motion.graphs.adjacency import make_graph
from poise.baselines.motion.graphs.motion_graph import GraphClip, Thresholds, read_graph
from poise.baselines.motion.retargeting.performed import load_clip, robot_clip_of
from poise.baselines.motion.retargeting.robot_bvh import clip_of_robot
from poise.baselines.motion.synthesis.actions import check_clips
from poise.baselines.motion.synthesis.plan import PHYSICAL
from poise.baselines.motion.synthesis.robot_joins import RobotJoins
from poise.baselines.motion.synthesis.scripts.tree import Script, clip_names
from poise.baselines.motion.synthesis.synthesis import Synthesis
from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import is_file
from poise.configs.schema import build
from poise.envs.robots.robot import Robot, load_robot
from poise.training.running.terminal import clips_bar

CLIP_FILES = (".bvh", ".npz", ".yaml")  # that a script may name in quotes


def open_synthesis(
    file: Path | None,
    robot: str | None,
    kind: str | None = None,
    least: float | None = None,
    script: Script | None = None,
    console: Console | None = None,
) -> Synthesis:
    """Return the clips of a graph, or the packaged ones, ready for scripts.

    For a robot packaged motions with steps are loaded where the script names them: in the ways of
    others they have no place.

    Args:
        file: of the graph; None for the packaged clips.
        robot: whose motions the clips are to be; None for their own skeleton.
        kind: of transitions that scripts leave open; None for `physical` with a robot, else
            `insert`.
        least: shortest transition of the packaged clips [s].
        script: to perform.
        console: shows which clips are loaded, for a robot a second or more each; None: none.

    Raises:
        ConfigError: a clip of the script that there is not, before any is loaded; a graph of
            another robot, a clip that changed, `physical` without a robot; as `read_graph` and
            `load_clip`.
    """
    body = None if robot is None else load_robot(robot)
    joins = None if body is None else RobotJoins(body)
    kind = kind or (PHYSICAL if joins else "insert")
    if file is not None:
        made = read_graph(file)
        if (robot or "") != made.robot:
            raise ConfigError(f"is of {made.robot or 'no robot'}, not of {robot or 'none'}",
                              source=file, field="robot")  # fmt: skip
        if script is not None:
            check_clips(script, made.names)
        loaded = load_clips([_beside(clip.file, file) for clip in made.clips], body,
                       [clip.name for clip in made.clips], console)  # fmt: skip
        for recorded, (found, _) in zip(made.clips, loaded, strict=True):
            if recorded.digest and recorded.digest != found.digest:
                raise ConfigError(
                    f"is not the file that it was: {recorded.file}; make the graph again",
                    source=file, field=f"clips.{recorded.name}")  # fmt: skip
        return Synthesis(made, {entry.name: clip for entry, clip in loaded}, kind,
                         robot_joins=joins)  # fmt: skip
    names = packaged_clips()
    steps: list[str] = []
    if robot is not None:  # clips whose feet stay; of those whose feet move the motion, if any
        walks, motions = [name for name in names if name.endswith("_walk")], motions_with_steps()
        moving = ("_walk", *(f"_{motion}" for motion in motions))
        names = [name for name in names if not name.endswith(moving)]
        steps = [*walks, *motions]
    said = set() if script is None else clip_names(script)
    names += [name for name in steps if any(name == n or name.endswith(f"_{n}") for n in said)]
    files = sorted(name for name in said if Path(name).suffix in CLIP_FILES and is_file(name))
    others = [name for name in steps if name not in names]
    if script is not None:
        check_clips(script, [*names, *files], others)
    limits = Thresholds() if least is None else build(Thresholds, {"least": least}, "synth")
    loaded = load_clips([*names, *files], body, [*names, *files], console)
    return Synthesis(make_graph(loaded, limits, robot=robot or ""),
                     {entry.name: clip for entry, clip in loaded}, kind,
                     robot_joins=joins, others=others)  # fmt: skip


def load_clips(
    files: Sequence[str],
    robot: Robot | None,
    names: Sequence[str] | None = None,
    console: Console | None = None,
) -> list[tuple[GraphClip, Clip]]:
    """Return the clips of files with what a graph keeps of them; see `load_clip`. A `console`
    shows how far it is."""
    loaded: list[tuple[GraphClip, Clip]] = []
    with clips_bar(None if robot is None else console) as bar:  # else it is quick
        task = bar.add_task("", total=len(files), rate="")
        for file, name in zip(files, names or [Path(file).stem for file in files], strict=True):
            bar.update(task, completed=len(loaded), rate=name)
            clip, digest = load_clip(file, robot)
            loaded.append((GraphClip(name, file, clip.duration, digest), clip))
        bar.update(task, completed=len(loaded), rate="")
    return loaded


def _beside(file: str, graph_file: Path) -> str:
    """Return a clip's file, looked for beside the graph's file too."""
    beside = graph_file.parent / file
    return str(beside) if Path(file).suffix and not is_file(file) and is_file(beside) else file


def write_motion(
    synthesis: Synthesis, script: Script, robot: str | None, out: Path
) -> dict[str, Any]:
    """Make the motion of a script, and write it with the record of every choice beside it.

    Returns the record, with the `duration` of the motion and the `seconds` that it took [s]. Raises
    ConfigError and PoiseError as `Synthesis.make` and `robot_clip_of`.
    """
    begin = time.monotonic()
    clip, record = synthesis.make(script)
    if robot is None:
        write_bvh(clip, out)
    else:
        write_robot_motion(clip, load_robot(robot), out, script.source)
    record["seconds"] = round(time.monotonic() - begin, 3)
    text = json.dumps(record, indent=1, ensure_ascii=False)
    write_atomic(out.with_suffix(".plan.json"), text + "\n")
    return record


def write_robot_motion(clip: Clip, robot: Robot, out: Path, source: str) -> None:
    """Write a clip of the robot's skeleton as its motion (.npz), or as BVH.

    Raises ConfigError and PoiseError as `robot_clip_of`.
    """
    made = robot_clip_of(clip, robot, out.stem, source)
    if out.suffix == ".npz":
        write_robot_clip(made, out)
    else:
        write_bvh(clip_of_robot(robot, made.qpos, made.dt, out.stem), out)
