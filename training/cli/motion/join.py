"""`poise motion join` and `match`: one clip after the other, and a motion that is asked for."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.graphs.joining.coefficient import (
    best_duration,
    coefficient,
    moved_shares,
)
from poise.baselines.motion.graphs.joining.joins import JOINS, ends
from poise.configs.errors import ConfigError
from poise.configs.outputs import check_out_file
from poise.envs.robots.robot import load_robot
from poise.training.running.terminal import terminal

Files = Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
Clips = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]


def join(
    first: Clips,
    second: Clips,
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")],
    /,
    *,
    kind: Literal["insert", "cross", "capture", "inertial", "physical"] = "insert",
    duration: float | None = None,
    leave: float | None = None,
    enter: float = 0.0,
    robot: str = "humanoid",
) -> None:
    """Play one clip after the other, with a transition between them; see docs/motion-synthesis.md.

    Args:
        first: a .bvh file, or the name of a packaged clip; for physical a robot's .npz.
        second: another file of the same skeleton or robot.
        out: the .bvh file to write; for physical a .npz.
        kind: kind of the transition; physical lasts as long and bends as much as the robot needs.
        duration: duration of the transition [s], of inertial the half-life; by default the one
            with the smallest coefficient.
        leave: time at which physical leaves the first [s]; by default its end.
        enter: time at which physical enters the second [s].
        robot: robot of the .npz files: a packaged one or a .yaml description.
    """
    if kind == "physical":
        if duration is not None:
            raise ConfigError("a physical join lasts as long as the robot needs", field="duration")
        _physical(first, second, out, robot, leave, enter)
        return
    if leave is not None or enter:
        raise ConfigError("is for physical joins: use poise motion convert --cut",
                          field="enter" if leave is None else "leave")  # fmt: skip
    before, after = (read_bvh(find_bvh(file)).clip for file in (first, second))
    shares = moved_shares(before.skeleton)
    gap, rate, next_rate = ends(before, after)
    if duration is None:
        duration = best_duration(gap, rate, next_rate, shares).duration
    write_bvh(JOINS[kind](before, after, duration), out)
    price = float(coefficient(gap, rate, next_rate, shares, duration))
    print(f"{kind}, {duration:.2f} s, coefficient {price:.3g}")
    print(out)


def match(
    files: Files = (),
    /,
    *,
    commands: tuple[str, ...],
    out: Path,
    seconds: float = 10.0,
    start: str = "",
) -> None:
    """Make a motion that follows velocity commands, by motion matching (docs/motion-synthesis.md).

    Args:
        files: .bvh files or names of packaged clips, all of one skeleton; by default the packaged
            ones, with a walk of 0.3 to 1.2 m/s.
        commands: commands from a time on, as SECONDS:FORWARD,LEFT,TURN in m/s and rad/s.
        out: the .bvh file to write.
        seconds: duration of the motion [s].
        start: where the motion begins, as CLIP@SECONDS; by default the first frame of the first
            clip.
    """
    from poise.training.motion.following.matched import matched, parse_timed_commands, print_matched

    if out.suffix != ".bvh":
        raise ConfigError("must be the name of a .bvh file", source=out, choices=("*.bvh",))
    check_out_file(out)
    made, database = matched(files, commands, seconds, start)
    write_bvh(made.clip, out)
    print_matched(made, database, parse_timed_commands(commands), terminal())
    print(out)


def _physical(
    first: Path, second: Path, out: Path, robot: str, leave: float | None, enter: float
) -> None:
    """Join two motions of a robot by what it can do."""
    from poise.baselines.balance.references.robot_clip import read_robot_clip, write_robot_clip
    from poise.baselines.motion.feasibility.physical import physical_join

    clips = [read_robot_clip(file) for file in (first, second)]
    made = physical_join(load_robot(robot), *clips, leave=leave, enter=enter)
    write_robot_clip(made.clip, out)
    for part in made.parts:
        bent = ", bent" if part.bent else ""
        inside = 100.0 * part.feasibility.zmp_margin.min()
        torque = part.feasibility.torque.max()
        print(f"physical, {part.duration:.2f} s{bent}, coefficient {part.coefficient:.3g}, "
              f"ZMP {inside:.1f} cm inside, torque {torque:.0%}")  # fmt: skip
    if made.through_standing:
        print("through standing: there is no direct way")
    print(out)
