"""The limits of a join, whose first and last samples are also the clips'."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from .check import Feasibility, FeasibilityLimits

EDGE = 0.1  # [s] beside a cut in which a join may be as bad as the clip is there
FADE = 0.1  # [s] after that in which it may be so in part
#: arrays of `Feasibility` with a row for each sample
SAMPLED = ("times", "zmp", "zmp_margin", "reach", "friction", "load", "torque", "speed", "excess",
           "drift", "gap")  # fmt: skip
MORE = 1.05  # times as bad, since splines through other frames differ a little


def clip_limits(own: Feasibility) -> FeasibilityLimits:
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


def faded(own: Feasibility, share: float) -> FeasibilityLimits:
    """Limits of which `share` are those of `clip_limits`, and the rest the limits themselves."""
    hard, soft = own.limits, clip_limits(own)
    values = {field.name: _between(getattr(hard, field.name), getattr(soft, field.name), share)
              for field in fields(hard)}  # fmt: skip
    return FeasibilityLimits(**values)


def masked(judged: Feasibility, kept: np.ndarray, limits: FeasibilityLimits) -> Feasibility:
    """The samples of a mask (n,), against other limits."""
    samples = [name for name in SAMPLED if getattr(judged, name) is not None]
    cut: dict[str, Any] = {name: getattr(judged, name)[kept] for name in samples}
    return replace(judged, limits=limits, **cut)


def between_clips(judged: Feasibility, before: Feasibility, after: Feasibility) -> str:
    """Why a join is not possible; empty if it is.

    Its limits hold but beside each cut. For 0.1 s it may be as bad there as the clips `before` and
    `after` it are: what a clip asks for at its cut is not the join's doing. For 0.1 s more it may
    be two thirds and then one third as bad, since a smooth curve does not end at once what the
    clip has begun.
    """
    times, last = judged.times, float(judged.times[-1])
    shares = np.array([_shares(away) for away in (times, last - times)])
    side, share = shares.argmax(axis=0), shares.max(axis=0)
    side[(share > 0.0) & (times > 0.5 * last) & (shares[0] == shares[1])] = 1
    for own, number in ((before, 0), (after, 1)):
        for value in np.unique(share[side == number]):
            limits = faded(own, float(value)) if value > 0.0 else judged.limits
            one = masked(judged, (side == number) & (share == value), limits)
            if not one.feasible:
                return one.reason
    return ""


def _shares(away: np.ndarray) -> np.ndarray:
    """(n,) how much of a clip's own ease holds at times `away` (n,) from its cut [s]."""
    steps = np.ceil((away - EDGE - 1e-9) / (FADE / 2.0))  # 0 beside the cut, then 1, 2, …
    return np.asarray(np.clip(1.0 - np.maximum(steps, 0.0) / 3.0, 0.0, 1.0))


def _between(hard: Any, soft: Any, share: float) -> Any:
    """A limit, or a pair of limits, some way from one to another."""
    if isinstance(hard, tuple):
        return tuple(_between(h, s, share) for h, s in zip(hard, soft, strict=True))
    return hard + share * (soft - hard)


def _lower(values: np.ndarray) -> float:
    """The least, and a little less."""
    least = float(values.min())
    return least - (MORE - 1.0) * abs(least)
