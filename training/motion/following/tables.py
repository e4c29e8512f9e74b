"""What a person reads of followed motions and of retargeting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.baselines.motion.clips.axes import LEG, UNITS, FileAxes
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.feasibility.check import Feasibility, shown
from poise.baselines.motion.space_time.constraints.constraint import Violation
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip

from .follow import Followed

#: what is shown of a motion with steps: name, field, factor, unit
WALK = (
    ("went, of the way told", "walked", 100.0, "%"),
    ("turned, of what was told", "turned", 100.0, "%"),
)
STEPS = (
    ("a sole in the air, RMS", "swing_error", 1e3, "mm"),
    ("a sole as it lands, at most", "placement_error", 1e3, "mm"),
    ("a planted sole slid by", "support_slide", 1e3, "mm"),
    ("left to catch a fall", "interruptions", 1.0, "times"),
)


def print_followed(trials: Sequence[Followed], title: str, console: Console) -> None:
    """Falls, and errors over the trials that did not fall."""
    table = _table(title)
    falls = sum(trial.fallen for trial in trials)
    table.add_row("trials, falls", f"{len(trials)}, {falls}")
    table.add_row("solver failures", str(sum(trial.solver_failures for trial in trials)))
    stood = [trial for trial in trials if not trial.fallen]
    walked = any(np.isfinite([(trial.walked, trial.turned) for trial in stood]).ravel())
    stepped = any(np.isfinite(trial.swing_error) for trial in trials)
    for name, field, factor, unit in (
        ("joints, RMS", "joint_rms", np.degrees(1.0), "°"),
        ("bodies, mean distance", "body_error", 1e3, "mm"),
        ("the same, from the root", "body_error_root", 1e3, "mm"),
        ("bodies in the last second", "body_error_last", 1e3, "mm"),
        ("centre of mass", "com_error", 1e3, "mm"),
        *(WALK if walked else ()),
        *(STEPS if stepped else (("a sole slid or stepped by", "sole_slide", 1e3, "mm"),)),
    ):
        values = [factor * getattr(trial, field) for trial in stood]
        values = [value for value in values if np.isfinite(value)]
        text = f"{np.mean(values):.1f} {unit}, largest {max(values):.1f}" if values else "-"
        table.add_row(name, text)
    console.print(table)


def _unit(metres: float) -> str:
    """The unit of a file, by name where it has one."""
    named = [name for name, length in UNITS.items() if abs(length / metres - 1.0) < 1e-9]
    return f"{named[0]} ({metres:g} m)" if named else f"{metres:.4g} m, so that legs are {LEG} m"


def print_clip(clip: Clip, axes: FileAxes, console: Console) -> None:
    """What a file of motion capture holds, and how it was understood."""
    contacts = measure_contacts(clip)
    up, forward = axes.names
    table = _table(clip.name)
    for name, value in (
        ("joints", f"{len(clip.skeleton.names)}, {len(clip.skeleton.roles)} of them with a role"),
        ("frames", f"{len(clip)} at {1 / clip.dt:.4g} Hz, {clip.duration:.2f} s"),
        ("unit, up, forward", f"{_unit(axes.unit)}, {up}, {forward}"),
        ("legs", f"{clip.skeleton.leg_length:.3f} m"),
        ("planted, left and right", "{:.0%}, {:.0%}".format(*contacts.planted.mean(axis=0))),
        ("feet stay in place", f"{'yes' if contacts.in_place else 'no'}, they move by "
         f"{100 * contacts.wander.max():.1f} cm"),
        ("skating, mean and largest", f"{100 * contacts.skating:.1f}, "
         f"{100 * contacts.skating_largest:.1f} cm/s"),
        ("below the floor", f"{1000 * contacts.penetration:.1f} mm"),
    ):  # fmt: skip
        table.add_row(name, value)
    console.print(table)


def print_retargeted(made: RetargetedClip, console: Console) -> None:
    """What the robot's postures miss, and which of the user's constraints are violated."""
    table = _table(f"{made.clip.about.name} on {made.clip.about.robot}, by {made.solver}")
    quality = made.quality
    worst = sorted(quality.directions.items(), key=lambda item: -item[1])
    directions = ", ".join(f"{name} {np.degrees(error):.1f}°" for name, error in worst)
    hands = ", ".join(f"{side} {100 * error:.1f} cm" for side, error in quality.hands.items())
    for name, value in (
        (
            "frames",
            f"{len(made.clip.qpos)} at {1 / made.clip.dt:.3g} Hz, {made.clip.duration:.2f} s",
        ),
        ("legs over the clip's", f"{made.scale:.3f}"),
        ("steps", _steps(made)),
        ("off the ground", _flight(made)),
        *_walks(made),
        ("soles off their places", f"{1000 * quality.sole_error:.2g} mm at most"),
        ("skating, mean and largest", f"{100 * quality.skating:.2g}, "
         f"{100 * quality.skating_largest:.2g} cm/s"),
        ("over joint limits", f"{np.degrees(quality.limit_excess):.2g}°"),
        ("in the floor or in itself", f"{1000 * quality.penetration:.2g} mm at most"),
        ("hands off their places, mean", hands or "not measured"),
        ("directions, RMS", directions),
        ("third derivative of joints, RMS", f"{quality.jerk:.1f} rad/s³"),
        ("time a frame", f"{1000 * made.time_per_frame:.1f} ms of the processor"),
    ):  # fmt: skip
        table.add_row(name, value)
    console.print(table)
    if quality.violations:
        print_violations(quality.violations, console)
    if made.clip.about.unperformed:
        console.print(f"Can be seen, but not performed: {escape(made.clip.about.unperformed)}")


def print_violations(violations: Sequence[Violation], console: Console) -> None:
    """By how much each constraint of the user's is missed, where it is missed most."""
    missed = sum(not each.holds for each in violations)
    table = Table(title=f"constraints, {missed} of {len(violations)} violated",
                  title_justify="left")  # fmt: skip
    for name in ("constraint", "missed by", "at", ""):
        table.add_column(name)
    for each in violations:
        table.add_row(escape(each.about), f"{each.largest:.3g} {each.unit}", f"{each.time:.2f} s",
                      "" if each.holds else "violated")  # fmt: skip
    console.print(table)


def _steps(made: RetargetedClip) -> str:
    planted = made.clip.planted
    if planted is None:
        return "none"
    steps = int(np.sum(np.diff(planted.astype(int), axis=0) > 0))
    tempo = "" if made.tempo == 1.0 else f", {made.tempo:.0%} as fast as the clip"
    return f"{steps}, {made.stride:.0%} of the length that the legs' scale gives{tempo}"


def _walks(made: RetargetedClip) -> list[tuple[str, str]]:
    told = made.clip.commands
    if told is None:
        return []
    ahead, left, turn = np.abs(told[:, 1:4]).max(axis=0)
    planted = made.clip.planted
    run = planted is not None and not planted.any(axis=1).all()
    return [
        (
            "performed by a planner that walks",
            f"{'a run as a walk, ' if run else ''}at {made.tempo:.2f} of the clip's speed: up to "
            f"{np.hypot(ahead, left):.2f} m/s and {np.degrees(turn):.0f} °/s (--controller walk)",
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
    table = Table(title=escape(title), title_justify="left")
    for name in ("criterion", "worst", "at", "where", "needed", ""):
        table.add_column(name)
    for c in judged.criteria:
        sign = "≥" if c.least else "≤"
        table.add_row(c.name, shown(c.worst, c.unit), f"{c.time:.2f} s", c.where,
                      f"{sign} {shown(c.bound, c.unit)}", "" if c.holds else "no")  # fmt: skip
    console.print(table)


def _table(title: str) -> Table:
    table = Table(title=escape(title), title_justify="left", show_header=False)
    table.add_column("of the motion", no_wrap=True)
    table.add_column("value", overflow="fold")
    return table
