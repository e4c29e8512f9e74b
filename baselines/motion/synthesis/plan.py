"""What a script is to play, and what is played."""

from dataclasses import dataclass
from typing import Any

from poise.baselines.motion.graphs.paths import Path

from .actions import Actions
from .robot_joins import Way

PHYSICAL = "physical"  # the kind of transitions that a robot's abilities decide


@dataclass(frozen=True)
class Played:
    """A clip, or a transition, as it is played.

    Attributes:
        what: name of the clip, or the kind of the transition.
        begins, ends: in the whole [s].
        enter, leave: times in the clip [s]; of a transition those of the clips about it.
        wanted: whether the script asks for it.
        coefficient: K of a transition; None for a clip.
        physics: of a physical transition what `Way.record` tells; None for others.
    """

    what: str
    begins: float
    ends: float
    enter: float
    leave: float
    wanted: bool
    coefficient: float | None = None
    physics: dict[str, Any] | None = None


@dataclass(frozen=True)
class Plan:
    """Paths of a script through a graph, the best one first.

    Attributes:
        actions: what is wanted.
        paths: with their costs.
        kinds: number of an action → the kind of the transition by hand after it.
    """

    actions: Actions
    paths: tuple[Path, ...]
    kinds: dict[int, str]


def played_lead(way: Way, begins: float) -> Played:
    """The record of a way from or to standing."""
    ends = begins + way.clip.duration
    return Played(PHYSICAL, begins, ends, 0.0, 0.0, False, None, way.record())
