"""A join against its limits, where the first and last samples are also the clips'."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .check import Feasibility, FeasibilityLimits

EDGE = 0.1  # [s] beside a cut in which a join may be as bad as the clip is there
#: arrays of `Feasibility` with a row for each sample
SAMPLED = ("times", "zmp", "zmp_margin", "friction", "load", "torque", "speed", "excess",
           "drift", "gap")  # fmt: skip
MORE = 1.05  # times as bad, since splines through other frames differ a little


def eased(own: Feasibility) -> FeasibilityLimits:
    """The limits, or what a clip itself takes where that is worse."""
    c = own.limits
    return replace(
        c,
        zmp_margin=min(c.zmp_margin, _lower(own.zmp_margin)),
        friction=max(c.friction, MORE * float(own.friction.max())),
        load=(min(c.load[0], _lower(own.load)), max(c.load[1], MORE * float(own.load.max()))),
        torque=max(c.torque, MORE * float(own.torque.max())),
        speed=max(c.speed, MORE * float(own.speed.max())),
        excess=max(c.excess, MORE * float(own.excess.max())),
    )


def part(judged: Feasibility, begin: float, end: float, limits: FeasibilityLimits) -> Feasibility:
    """The samples from `begin` to `end` [s], against other limits."""
    kept = (judged.times >= begin - 1e-9) & (judged.times <= end + 1e-9)
    samples = [name for name in SAMPLED if getattr(judged, name) is not None]
    cut: dict[str, Any] = {name: getattr(judged, name)[kept] for name in samples}
    return replace(judged, limits=limits, **cut)


def between_clips(judged: Feasibility, before: Feasibility, after: Feasibility) -> str:
    """Why a join is not possible; empty if it is.

    Its limits hold but for 0.1 s beside each cut, where it may be as bad as the clips `before` and
    `after` it are there: what a clip asks for at its cut is not the join's doing.
    """
    last = float(judged.times[-1])
    edge = min(EDGE, 0.5 * last)
    for begin, end, limits in (
        (edge, last - edge, judged.limits),
        (0.0, edge, eased(before)),
        (last - edge, last, eased(after)),
    ):
        one = part(judged, begin, end, limits)
        if len(one.times) and not one.feasible:
            return one.reason
    return ""


def _lower(values: np.ndarray) -> float:
    """The least, and a little less."""
    least = float(values.min())
    return least - (MORE - 1.0) * abs(least)
