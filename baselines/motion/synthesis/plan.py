"""The plan of a script, and the parts of its motion."""

from dataclasses import dataclass
from typing import Any

from poise.baselines.motion.graphs.paths import Path

from .actions import Actions
from .robot_joins import Way

PHYSICAL = "physical"  # the kind of transitions that a robot's abilities decide


@dataclass(frozen=True)
class MotionPart:
    """A clip, or a transition, in a motion.

    Attributes:
        what: name of the clip, or the kind of the transition.
        begins, ends: in the whole [s].
        enter, leave: times in the clip [s]; of a transition those of the clips about it.
        wanted: whether the script asks for it.
        coefficient: K of a transition; None for a clip.
        physics: of a physical transition `Way.record`; None for others.
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


def lead_part(way: Way, begins: float) -> MotionPart:
    """Return the part of a way from or to standing."""
    ends = begins + way.clip.duration
    return MotionPart(PHYSICAL, begins, ends, 0.0, 0.0, False, None, way.record())
