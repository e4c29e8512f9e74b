"""`poise motion join`: one clip after the other."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

from poise.baselines.clips.bvh import read_bvh, write_bvh
from poise.baselines.clips.library import find_bvh
from poise.baselines.joining.coefficient import best_duration, coefficient, moved_shares
from poise.baselines.joining.joins import JOINS, ends

Clips = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]


def join(
    first: Clips,
    second: Clips,
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")],
    /,
    *,
    kind: Literal["insert", "cross", "capture", "inertial"] = "insert",
    duration: float | None = None,
) -> None:
    """Play one clip after the other, with a transition between them; see docs/motions.md.

    Args:
        first: a .bvh file, or the name of a packaged clip.
        second: the same, of the same skeleton.
        out: the .bvh file to write.
        kind: of the transition.
        duration: of the transition [s]; of inertial the half-life. None: where the coefficient is
            least.
    """
    before, after = (read_bvh(find_bvh(file)).clip for file in (first, second))
    shares = moved_shares(before.skeleton)
    gap, rate, next_rate = ends(before, after)
    if duration is None:
        duration = best_duration(gap, rate, next_rate, shares).duration
    write_bvh(JOINS[kind](before, after, duration), out)
    price = float(coefficient(gap, rate, next_rate, shares, duration))
    print(f"{kind}, {duration:.2f} s, coefficient {price:.3g}")
    print(out)
