"""What a way through a motion graph must do, and such a way."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from .motion_graph import Transition

Place = tuple[str, float]  # a clip and a time in it [s]


@dataclass(frozen=True)
class PathTask:
    """What a path must do.

    Attributes:
        actions: names of the clips, in this order.
        arrows: number of an action → the transition by hand that follows it.
        start: places where the path may begin, each with a cost; none for the first action's begin.
        goal: places where it may end, each with a cost; none for the last action's end.
    """

    actions: tuple[str, ...]
    arrows: Mapping[int, Transition] = field(default_factory=dict)
    start: Mapping[Place, float] = field(default_factory=dict)
    goal: Mapping[Place, float] = field(default_factory=dict)


class Step(NamedTuple):
    """A clip from one time to another [s]; `after` is the transition that follows, if any."""

    clip: str
    enter: float
    leave: float
    wanted: bool
    after: Transition | None


class Path(NamedTuple):
    """Steps in order and their cost."""

    steps: tuple[Step, ...]
    cost: float
