"""`poise motion …`: files of motion capture, on a robot, and performed."""

import shlex
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import tyro

from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.roles import ROLES
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip
from poise.configs.errors import ConfigError, meant, shown
from poise.configs.outputs import check_out_file
from poise.configs.problems import Problem, out_of_range
from poise.envs.robots.robot import Robot, load_robot
from poise.training.running.options.arguments import OnRobot, Switch
from poise.training.running.options.pages import print_commands
from poise.training.running.options.parsing import answered
from poise.training.running.terminal import terminal

from .check import check, follow
from .join import join, match
from .script import graph, plan, synth

USAGE = """usage: poise motion COMMAND [OPTIONS]

Motion capture: what files hold, a robot's motion of them, and performing it.
"""
Solver = Literal["frame", "spacetime", "grid"]
Unit = Annotated[
    str,
    tyro.conf.arg(
        help="unit of the file: m, cm, mm, dm, inch, a length in metres, or auto (from the legs).",
        metavar="UNIT",
    ),
]
Up = Annotated[
    str,
    tyro.conf.arg(help="axis of the file that is up, such as y or -z, or auto.", metavar="AXIS"),
]
Forward = Annotated[
    str,
    tyro.conf.arg(help="axis along which the rest pose faces, or auto.", metavar="AXIS"),
]
Joints = Annotated[
    tuple[str, ...],
    tyro.conf.arg(
        help="joints of roles that are not found, such as hip_left=Thigh_L.",
        metavar="ROLE=JOINT …",
    ),
]
File = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]


def info(
    file: File,
    /,
    *,
    unit: Unit = "auto",
    up: Up = "auto",
    forward: Forward = "auto",
    joints: Joints = (),
) -> None:
    """What a BVH file holds: joints, unit, axes, rate, planted feet, skating.

    Args:
        file: a .bvh file, or the name of a packaged clip.
    """
    from poise.training.motion.following.tables import print_clip

    clip, axes = read_bvh(find_bvh(file), unit, up, forward, named_joints(joints))
    print_clip(clip, axes, terminal())


def convert(
    file: File,
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")],
    /,
    *,
    unit: Unit = "auto",
    up: Up = "auto",
    forward: Forward = "auto",
    joints: Joints = (),
    cut: tuple[float, float] | None = None,
    speed: float = 1.0,
    mirror: Switch = False,
    reverse: Switch = False,
    turn: float = 0.0,
    close: float = 0.0,
    loop: int = 1,
    rate: float | None = None,
    robot: str = "humanoid",
) -> None:
    """Change a BVH file, in this order: cut, speed, mirror, reverse, close, loop, turn, rate.

    What is written has y up, z forward, and metres. A .npz of poise motion import becomes a BVH
    file of the robot.

    Args:
        file: a .bvh file, the name of a packaged clip, or a robot's .npz.
        out: the .bvh file to write.
        cut: two times [s]; what lies between is kept.
        speed: factor of the speed.
        mirror: exchange left and right.
        reverse: reverse the time.
        turn: angle to turn about the vertical axis [degrees].
        close: time over which the end is blended into the first frame [s]; 0 for none.
        loop: number of repetitions.
        rate: frames a second; those of the file if not given.
        robot: robot of the .npz: a packaged one or a .yaml description.
    """
    clip = _clip(file, unit, up, forward, robot, joints)
    if cut is not None:
        clip = clip.cut(*cut)
    clip = clip.at_speed(speed) if speed != 1.0 else clip
    clip = clip.mirrored() if mirror else clip
    clip = clip.reversed() if reverse else clip
    clip = clip.closed(close) if close else clip
    clip = clip.repeated(loop)
    clip = clip.turned(turn * 3.141592653589793 / 180.0) if turn else clip
    if rate is not None:
        if not 1.0 <= rate <= 1000.0:
            raise out_of_range(rate, field="rate", least=1, most=1000, form="g")
        clip = clip.resampled(1.0 / rate)
    write_bvh(clip, out)
    print(out)


def bring(
    file: File,
    /,
    *,
    out: Path,
    robot: OnRobot = "humanoid",
    unit: Unit = "auto",
    up: Up = "auto",
    forward: Forward = "auto",
    joints: Joints = (),
    cut: tuple[float, float] | None = None,
    speed: float = 1.0,
    mirror: Switch = False,
    smooth: float = 3.0,
    lead: float = 1.0,
    planted: Switch = False,
    solver: Solver | None = None,
    constraints: str | None = None,
    steps: Switch = False,
    kinematic: Switch = False,
    video: Path | None = None,
) -> None:
    """Retarget a BVH file to a robot, its soles planted where the clip's are; see docs/motions.md.

    The .npz file is taken wherever a motion is named. A clip whose feet move by 12 cm becomes a
    motion with steps, which motion-step performs. What cannot be performed becomes a motion that
    can be seen, by poise motion play and poise view, and the reason is printed.

    Args:
        file: a .bvh file, or the name of a packaged clip.
        out: the .npz file to write.
        cut: two times [s]; what lies between is kept.
        speed: factor of the speed.
        mirror: exchange left and right.
        smooth: cut-off of the low-pass on the targets [Hz].
        lead: time from standing into the clip, and back [s].
        planted: keep the feet planted even where they move in the clip.
        solver: frame by frame, spacetime for the optimum of the whole clip, grid for a stepwise
            search; by default spacetime if there are constraints, else frame.
        constraints: further constraints: a packaged name (see poise list) or a .yaml file.
        steps: keep the steps of the clip, for motion-step, even where legs make them short.
        kinematic: follow the clip even where it cannot be performed.
        video: a .mp4 or .webp file of the robot, and beside it the skeleton of the file.
    """
    from poise.baselines.balance.references.robot_clip import write_robot_clip
    from poise.baselines.motion.space_time.retarget_clip import retarget_clip
    from poise.training.motion.following.rehearsal import rehearsal
    from poise.training.motion.following.tables import print_retargeted
    from poise.training.pictures.figures.encoder import check_video

    check_out_file(out)
    if video is not None:
        check_video(video)
        check_out_file(video)
    clip = read_bvh(find_bvh(file), unit, up, forward, named_joints(joints)).clip
    clip = clip.cut(*cut) if cut is not None else clip
    clip = clip.at_speed(speed) if speed != 1.0 else clip
    clip = clip.mirrored() if mirror else clip
    body = load_robot(robot)
    made = retarget_clip(
        clip,
        body,
        solver=solver,
        constraints=constraints or (),
        smooth=smooth,
        lead=lead,
        planted=planted,
        kinematic=True if kinematic else False if steps else None,
        holds=rehearsal(body, said=partial(print, flush=True)),
        progress=partial(print, flush=True),
    )
    write_robot_clip(made.clip, out)
    print_retargeted(made, terminal())
    if video is not None:
        _film(video, body, clip, made)
    if made.performer:
        words = ["poise", "motion", "follow", str(out), "--robot", robot]
        print(f"perform it: {shlex.join([*words, '--controller', made.performer])}")
    print(out)


def play(
    file: File,
    /,
    *,
    video: Path,
    robot: str = "humanoid",
    unit: Unit = "auto",
    up: Up = "auto",
    forward: Forward = "auto",
    joints: Joints = (),
    size: tuple[int, int] = (640, 480),
    planted: Switch = False,
) -> None:
    """Show a motion without physics: the robot, and beside it the skeleton of the BVH file.

    Args:
        file: a .bvh file, the name of a packaged clip, or a robot's .npz, which has no skeleton.
        video: the .mp4 or .webp file to write.
        robot: robot to show: a packaged one or a .yaml description.
        size: width and height of the video [pixels], even.
        planted: keep the feet planted even where they move in the clip.
    """
    from poise.baselines.balance.references.robot_clip import check_clip_robot, read_robot_clip
    from poise.baselines.motion.space_time.retarget_clip import retarget_clip
    from poise.training.pictures.figures.encoder import check_video
    from poise.training.pictures.figures.playback import check_size, write_playback

    check_video(video)
    check_out_file(video)
    check_size(size)
    body = load_robot(robot)
    if file.suffix == ".npz":
        clip = read_robot_clip(file)
        check_clip_robot(clip, body, str(file))
        print(f"{write_playback(video, body, clip.qpos, clip.dt, None, size)} frames")
        print(video)
        return
    source = read_bvh(find_bvh(file), unit, up, forward, named_joints(joints)).clip
    _film(video, body, source, retarget_clip(source, body, solver="frame" if planted else None,
                                             planted=planted), size)  # fmt: skip


def _film(
    video: Path, body: Robot, source: Clip, made: RetargetedClip, size: tuple[int, int] = (640, 480)
) -> None:
    """Film a motion, with the skeleton of its clip beside it."""
    from poise.baselines.motion.clips.contacts import over_ground
    from poise.baselines.motion.retargeting.tracks import first_heading
    from poise.training.pictures.figures.playback import SkeletonMarks, write_playback

    clip, heading = made.clip, None
    if clip.planted is not None and not clip.free:
        heading = first_heading(source)
    source = over_ground(source) if made.tempo == 1.0 else source.at_speed(made.tempo)
    beside = SkeletonMarks(body, source, made.scale, made.begins, heading, made.stride)
    print(f"{write_playback(video, body, clip.qpos, clip.dt, beside, size)} frames")
    print(video)


MOTION: dict[str, Callable[..., object]] = {
    "info": info,
    "convert": convert,
    "import": bring,
    "follow": follow,
    "join": join,
    "check": check,
    "graph": graph,
    "plan": plan,
    "synth": synth,
    "match": match,
    "play": play,
}


def run_motion(args: Sequence[str]) -> int:
    """Run a sub-command of `poise motion`; returns 0, or 1 (see `check`)."""
    if not args or args[0] in ("-h", "--help", "--help-all"):
        print_commands(USAGE, MOTION, terminal())
        return 0
    name = args[0]
    if name not in MOTION:
        hint, value = meant(name, MOTION), f"motion {shown(name)}"
        raise Problem("unknown command", None, None, MOTION, value=value, hint=hint)
    return answered(MOTION[name], args[1:], f"poise motion {name}")


def named_joints(joints: Sequence[str]) -> dict[str, str]:
    """Role → name of the joint; raises ConfigError for what is not ``role=JOINT``."""
    pairs = dict(each.partition("=")[::2] for each in joints)
    for role, name in pairs.items():
        if not name:
            raise ConfigError(f"must be role=JOINT, not {shown(role)}", field="joints",
                              choices=ROLES)  # fmt: skip
    return pairs


def _clip(file: Path, unit: str, up: str, forward: str, robot: str, joints: Sequence[str]) -> Clip:
    """Return the clip of a BVH file, or of a robot's .npz."""
    if file.suffix != ".npz":
        return read_bvh(find_bvh(file), unit, up, forward, named_joints(joints)).clip
    from poise.baselines.balance.references.robot_clip import check_clip_robot, read_robot_clip
    from poise.baselines.motion.retargeting.robot_bvh import clip_of_robot

    stored, body = read_robot_clip(file), load_robot(robot)
    check_clip_robot(stored, body, str(file))
    return clip_of_robot(body, stored.qpos, stored.dt, file.stem)
