"""Printed tables of followed motions and of retargeting."""

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.markup import escape

from poise.baselines.motion.clips.axes import LEG, UNITS, FileAxes
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.feasibility.check import Feasibility, shown
from poise.baselines.motion.space_time.constraints.constraint import Violation
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip
from poise.training.running.columns import PERFORMED, Figure
from poise.training.running.tables import fact_table, text_table

from .follow import Followed

ERRORS = {*Followed.__dataclass_fields__} - {"motion_delay"}
#: of a walk, whose path is commanded, of footsteps, and of every motion
FIGURES = (
    Figure("walked", "walked", ".1f", "%", "of the commanded distance", 100.0),
    Figure("turned", "turned", ".1f", "%", "of the commanded turn", 100.0),
    Figure("footsteps", "steps", ".0f", "%", "number of footsteps, of the motion's", 100.0),
    Figure("footsteps_kept", "steps kept", ".0f", "%", "by the same foot within 0.1 s", 100.0),
    Figure("footstep_delay", "step delay", ".2f", "s", "of all footsteps of a walk, taken off"),
    Figure("footstep_place", "step places", ".0f", "mm", "from the other foot, mean error", 1e3),
    *(each for each in PERFORMED if each.key in ERRORS),
)


def print_followed(trials: Sequence[Followed], title: str, console: Console) -> None:
    """Falls, and errors over the trials that did not fall."""
    falls, failures = (sum(getattr(trial, name) for trial in trials)
                       for name in ("fallen", "solver_failures"))  # fmt: skip
    rows = []
    for each in FIGURES:
        values = each.scale * np.array([getattr(t, each.key) for t in trials if not t.fallen])
        if len(values := values[np.isfinite(values)]):
            mean, largest = (format(value, each.form) for value in (values.mean(), values.max()))
            rows.append((each.heading, each.words, mean, largest))
    title = f"{title}: {falls} of {len(trials)} fell, {failures} ticks unsolved"
    console.print(text_table(title, ("error", "which is"), ("mean", "largest"), rows))


def _unit(metres: float) -> str:
    """Return the unit of a file, by name where it has one."""
    named = [name for name, length in UNITS.items() if abs(length / metres - 1.0) < 1e-9]
    return f"{named[0]} ({metres:g} m)" if named else f"{metres:.4g} m, so that legs are {LEG} m"


def print_clip(clip: Clip, axes: FileAxes, console: Console) -> None:
    """What a file of motion capture holds, and how it was understood."""
    contacts = measure_contacts(clip)
    up, forward = axes.names
    console.print(fact_table(clip.name, (
        ("joints", f"{len(clip.skeleton.names)}, {len(clip.skeleton.roles)} of them with a role"),
        ("frames", f"{len(clip)} at {1 / clip.dt:.4g} Hz, {clip.duration:.2f} s"),
        ("unit, up, forward", f"{_unit(axes.unit)}, {up}, {forward}"),
        ("legs", f"{clip.skeleton.leg_length:.3f} m"),
        ("planted, left and right", "{:.0%}, {:.0%}".format(*contacts.planted.mean(axis=0))),
        ("feet fixed", f"{'yes' if contacts.in_place else 'no'}, they move by "
         f"{100 * contacts.wander.max():.1f} cm"),
        ("skating, mean and largest", f"{100 * contacts.skating:.1f}, "
         f"{100 * contacts.skating_largest:.1f} cm/s"),
        ("below the floor", f"{1000 * contacts.penetration:.1f} mm"),
    )))  # fmt: skip


def print_retargeted(made: RetargetedClip, console: Console) -> None:
    """What the robot's postures miss, and which of the user's constraints are violated."""
    quality = made.quality
    worst = sorted(quality.directions.items(), key=lambda item: -item[1])
    directions = ", ".join(f"{name} {np.degrees(error):.1f}°" for name, error in worst)
    hands = ", ".join(f"{side} {100 * error:.1f} cm" for side, error in quality.hands.items())
    title = f"{made.clip.about.name} on {made.clip.about.robot}, by {made.solver}"
    console.print(fact_table(title, (
        ("frames", f"{len(made.clip.qpos)} at {1 / made.clip.dt:.3g} Hz, "
         f"{made.clip.duration:.2f} s"),
        ("legs over the clip's", f"{made.scale:.3f}"),
        ("steps", _steps(made)),
        ("off the ground", _flight(made)),
        *_walks(made),
        ("soles off their places", f"{_rounded(1000 * quality.sole_error)} mm at most"),
        ("skating, mean and largest", f"{_rounded(100 * quality.skating)}, "
         f"{_rounded(100 * quality.skating_largest)} cm/s"),
        ("over joint limits", f"{_rounded(np.degrees(quality.limit_excess))}°"),
        ("in the floor or in itself", f"{_rounded(1000 * quality.penetration)} mm at most"),
        ("hands off their places, mean", hands or "not measured"),
        ("directions, RMS", directions),
        ("third derivative of joints, RMS", f"{quality.jerk:.1f} rad/s³"),
        ("time a frame", f"{1000 * made.time_per_frame:.1f} ms of the processor"),
    )))  # fmt: skip
    if quality.violations:
        print_violations(quality.violations, console)
    if made.clip.about.unperformed:
        console.print(f"Can be seen, but not performed: {escape(made.clip.about.unperformed)}")
    elif not made.held:
        console.print("When it was tried, it fell or took steps of its own: --speed slows it down.")


def _rounded(value: float) -> str:
    """Return two digits, and 0 for what is a rounding error in mm, cm/s or degrees."""
    return f"{value:.2g}" if value >= 1e-3 else "0"


def print_violations(violations: Sequence[Violation], console: Console) -> None:
    """By how much each constraint of the user's is missed, where it is missed most."""
    missed = sum(not each.holds for each in violations)
    rows = ((each.about, f"{each.largest:.3g} {each.unit}", f"{each.time:.2f} s",
             "" if each.holds else "violated") for each in violations)  # fmt: skip
    title = f"constraints, {missed} of {len(violations)} violated"
    console.print(text_table(title, ("constraint", "missed by", "at", ""), (), rows))


def _steps(made: RetargetedClip) -> str:
    planted = made.clip.planted
    if planted is None:
        return "none"
    steps = int(np.sum(np.diff(planted.astype(int), axis=0) > 0))
    tempo = "" if made.tempo == 1.0 else f", {made.tempo:.0%} as fast as the clip"
    less = "" if made.spread == 1.0 else f", {made.spread:.0%} of the clip's width"
    sunk = f", the body up to {100 * made.sunk:.1f} cm lower to reach" if made.sunk > 1e-3 else ""
    return f"{steps}, {made.stride:.0%} of the length that the legs' scale gives{tempo}{less}{sunk}"


def _walks(made: RetargetedClip) -> list[tuple[str, str]]:
    commands = made.clip.commands
    if commands is None:
        return []
    ahead, left, turn = np.abs(commands[:, 1:4]).max(axis=0)
    planted = made.clip.planted
    run = planted is not None and not planted.any(axis=1).all()
    less = "" if made.stride == 1.0 else f", its steps {made.stride:.2f} of their length"
    flies = "off the ground in the clip, performed as a walk, " if run else ""
    other = f"; its steps are not the clip's ({made.bound})" if made.bound else ""
    other += "; trunk and arms balance the robot" if made.clip.about.free_arms else ""
    return [
        (
            "performed by a planner that walks",
            f"{flies}at {made.tempo:.2f} of the clip's speed{less}: "
            f"up to {np.hypot(ahead, left):.2f} m/s and {np.degrees(turn):.0f} °/s "
            f"(--controller {made.walker}){other}",
        )
    ]


def _flight(made: RetargetedClip) -> str:
    planted = made.clip.planted
    flying = np.zeros(0, int) if planted is None else np.flatnonzero(~planted.any(axis=1))
    if not len(flying):
        return "never"
    share = "" if made.flight == 1.0 else f", {made.flight:.0%} as long as the clip at a time"
    first = flying[0] * made.clip.dt
    return f"{len(flying) * made.clip.dt:.2f} s, first at {first:.2f} s{share}"


def print_feasibility(judged: Feasibility, title: str, console: Console) -> None:
    """Each criterion at its worst sample."""
    rows = (
        (c.name, shown(c.worst, c.unit), f"{c.time:.2f} s", c.where,
         f"{'≥' if c.least else '≤'} {shown(c.bound, c.unit)}", "" if c.holds else "no")
        for c in judged.criteria
    )  # fmt: skip
    headings = ("criterion", "worst", "at", "where", "needed", "")
    console.print(text_table(title, headings, (), rows))
