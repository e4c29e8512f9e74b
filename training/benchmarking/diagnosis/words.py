"""A diagnosis in words: one line on a trial, a few words to count trials by."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from poise.envs.physics.pushes.push import Kick, Push
from poise.training.running.summary import Loss

from .diagnosis import COLUMNS, Diagnosis

LOSSES = {
    "height": "fell: its CoM sank too low",
    "tilt": "fell: its trunk tilted too far",
    "contact": "fell: {body} touched the ground",
    "diverged": "the simulation diverged",
    "not quiet": "stood at the end, but was not upright and at rest",
    "off command": "stayed upright, but did not walk on as commanded again",
    "motion": "fell from the motion",
    "down": "did not get up",
    "error": "the controller raised an error",
}
FEET = {"slipped": "a foot slipped", "missed": "a foothold missed"}
NUMBERS = {name for name, hint in Diagnosis.__annotations__.items() if "float" in str(hint)}
#: column of a cause → column of its size
SIZES = {"saturated_from": "saturated_time", "foothold_time": "foothold_error",
         "capture_left": "capture_outside"}  # fmt: skip
DIRECTIONS = ("forward", "forward left", "left", "backward left", "backward", "backward right",
              "right", "forward right")  # fmt: skip
SIDE = re.compile(r"(^|_)(left|right|l|r)(?=_|$)")


def diagnosis_of(line: Mapping[str, str]) -> Diagnosis:
    """Return the diagnosis in a line of trials.csv; empty where older results have none.

    Raises ValueError for a number that is none, and for a cause without its time or size.
    """
    given: dict[str, Any] = {name: line.get(name) or None for name in COLUMNS}
    for name in NUMBERS:
        given[name] = None if given[name] is None else float(given[name])
    for cause, size in SIZES.items():
        if given[cause] is not None and given[size] is None:
            raise ValueError(f"{cause} without {size}")
    return Diagnosis(**given)


def why(d: Diagnosis, fall_time: float | None = None) -> str:
    """Return the causes of a lost trial in order of time; empty for a recovered one."""
    if d.loss is None:
        return ""
    end = LOSSES.get(d.loss, d.loss).replace("{body}", d.loss_body or "a body")
    if fall_time is not None and d.loss not in ("not quiet", "off command"):
        end += f" at {fall_time:.2f} s"
    causes: list[tuple[float, str]] = []
    if d.saturated_motor is not None and d.saturated_from is not None:
        since, lasted = f"{d.saturated_from:.2f}", f"{d.saturated_time:.2f}"
        causes.append((d.saturated_from, f"{d.saturated_motor} at its torque limit from {since} s, "
                                         f"for {lasted} s"))  # fmt: skip
    if d.failures_from is not None:
        then = ", when it was falling already" if _fell_before(d) else ""
        causes.append(
            (d.failures_from, f"no solution of its QP from {d.failures_from:.2f} s on{then}")
        )
    if d.foothold is not None and d.foothold_time is not None:
        what, missed = FEET.get(d.foothold, d.foothold), f"{d.foothold_error:.2f} m"
        causes.append((d.foothold_time, f"{what} by {missed} at {d.foothold_time:.2f} s"))
    if d.capture_left is not None:
        causes.append((d.capture_left, "capture point outside of the support for good from "
                     f"{d.capture_left:.2f} s, by {d.capture_outside:.2f} m at most"))  # fmt: skip
    if d.hardware is not None:
        causes.append((float("inf"), d.hardware))
    before = "; ".join(text for _, text in sorted(causes))
    return f"{end}. Before: {before}." if before else f"{end}."


def cause(d: Diagnosis, steps: int | None) -> str:
    """Return the cause of a loss in a few words, without numbers and sides, to count by.

    `steps` is the number of planned steps, None of a controller that plans none.
    """
    if d.loss in ("diverged", "error", "down"):
        return LOSSES[d.loss]
    first = "no motor of the legs at its torque limit"
    if d.hardware is not None:
        first = d.hardware
    elif steps is None and _left_before(d, d.saturated_from):  # steps may bring it back
        first = "capture point outside of the support"
    elif d.saturated_motor is not None:
        first = f"{SIDE.sub('', d.saturated_motor).strip('_')} at its torque limit"
    if d.failures_from is not None and d.failures_from <= (d.saturated_from or float("inf")):
        first = first if _fell_before(d) else "QP without a solution"
    then = {None: "", 0: "no planned step", 1: "one step was not enough"}.get(
        steps, "its steps were not enough"
    )
    slipped = d.foothold == "slipped" and (d.foothold_time or 0.0) <= (d.capture_left or 0.0)
    if slipped or d.foothold == "missed":  # a sole that slips later is one of a robot that falls
        then = FEET[d.foothold or ""]
    if d.loss == "not quiet":
        then = "did not come to rest"
    if d.loss == "off command":
        then = "left its command"
    return f"{first}, then {then}" if then else first


def _left_before(d: Diagnosis, time: float | None) -> bool:
    """Return whether the capture point had left the support for good at `time` (None: never): what
    comes after that is a consequence of the fall, not its cause."""
    return d.capture_left is not None and d.capture_left <= (float("inf") if time is None else time)


def _fell_before(d: Diagnosis) -> bool:
    """Return whether the capture point had left the support for good when the QP first failed: no
    torques then bring it back, and a foot that tilts or lifts leaves the QP without the forces that
    it needs. The failure is a consequence of the fall, not its cause."""
    return d.failures_from is not None and _left_before(d, d.failures_from)


def losses(lost: Iterable[tuple[Diagnosis, int]], stepping: bool = True) -> list[Loss]:
    """Return the causes of lost trials (diagnosis, planned steps), the most frequent one first.

    Not `stepping`: the controller plans no steps, so none is missing.
    """
    counts = Counter(
        cause(d, steps if stepping else None) for d, steps in lost if d.loss is not None
    )
    return [{"cause": name, "trials": count} for name, count in counts.most_common()]


def losses_text(found: list[Loss]) -> str:
    """Return the three most frequent causes in a line: of 57 losses 31: …; 9: …"""
    total = sum(loss["trials"] for loss in found)
    some = "; ".join(f"{loss['trials']}: {loss['cause']}" for loss in found[:3])
    return f"of {total} losses {some}" if found else ""


def push_text(push: Push | Kick) -> str:
    """Return a push or a kick in words."""
    where = f"{push.direction:g}° ({towards(push.direction)}), at {push.start:.2f} s"
    if isinstance(push, Kick):
        return f"a kick of {push.delta_v:.2f} m/s towards {where}"
    return (f"a push of {push.impulse:.1f} N·s in {push.duration:.2f} s on {push.body} towards "
            f"{where}")  # fmt: skip


def towards(direction: float) -> str:
    """Return the name of the nearest of eight directions [deg]."""
    return DIRECTIONS[round(direction / 45.0) % len(DIRECTIONS)]
