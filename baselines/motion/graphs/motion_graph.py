"""Which clip may follow which, and where: an adjacency matrix as plain data, and its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path

import numpy as np
import yaml

from poise.configs.errors import ConfigError, shown
from poise.configs.files import write_atomic
from poise.configs.reading import read_yaml
from poise.configs.schema import build, to_yaml

MOST_CLIPS, MOST_TRANSITIONS = 200, 6000  # the reader of YAML takes no more values

PART = 0.25  # of a clip: an action is entered in its first part and left in its last one

Edge = tuple[str, str, float, float, float, float]


@dataclass(frozen=True)
class Thresholds:
    """When a transition is possible, and what it costs.

    Attributes:
        coefficient: largest K of a transition, see `coefficient.py`.
        angle: largest turn of a joint in it [deg].
        contacts: whether the same feet must be planted on both sides.
        least, most: durations [s].
        time_price: λ, of a second of transition or of clips not in the script, in units of K.
        apart: two transitions of a pair differ by this or more, in either clip [s].
        each: most transitions of a pair.
    """

    coefficient: float = field(default=20.0, metadata={"above": 0.0})
    angle: float = field(default=120.0, metadata={"above": 0.0, "max": 180.0})
    contacts: bool = True
    least: float = field(default=0.2, metadata={"min": 0.05, "max": 60.0})
    most: float = field(default=2.0, metadata={"min": 0.05, "max": 60.0})
    time_price: float = field(default=5.0, metadata={"above": 0.0, "max": 1e6})
    apart: float = field(default=1.0 / 3.0, metadata={"min": 0.0, "max": 60.0})
    each: int = field(default=6, metadata={"min": 1, "max": 100})

    def __post_init__(self) -> None:
        if self.least > self.most:
            raise ValueError(f"least {self.least:g} s is more than most {self.most:g} s")


@dataclass(frozen=True)
class Transition:
    """From a time of one clip to a time of another, as an edge of the graph.

    Attributes:
        before, after: names of the clips.
        leave, enter: times in them [s].
        duration: D [s].
        coefficient: K(D).
    """

    before: str
    after: str
    leave: float
    enter: float
    duration: float
    coefficient: float


#: sorts transitions by clips, then by times
transition_order = attrgetter("before", "after", "leave", "enter")


@dataclass(frozen=True)
class GraphClip:
    """A clip of a graph: its name in scripts, its file and length [s], and the file's SHA-256."""

    name: str
    file: str
    duration: float = field(metadata={"above": 0.0, "max": 100_000.0})
    digest: str = ""


@dataclass(frozen=True)
class Weight:
    """What an expert says of a pair: a factor of its K, or null for never.

    A pair with a factor has the transition from end to begin whatever the thresholds say.
    """

    before: str
    after: str
    weight: float | None = field(metadata={"above": 0.0, "max": 1e6})


@dataclass(frozen=True)
class StatePlace:
    """A posture by where a clip has it."""

    clip: str
    time: float = field(default=0.0, metadata={"min": 0.0})


@dataclass(frozen=True)
class MotionGraph:
    """Clips, transitions between them, and why other pairs have none.

    Attributes:
        robot: whose motions the clips are; empty for the skeleton of the files.
        thresholds: by which transitions were chosen.
        clips: in the order of the adjacency matrix.
        states: name of a posture → where it is.
        weights: of an expert.
        transitions: of all pairs; one without is not adjacent.
        refused: pair → the reason why it has none.
    """

    robot: str
    thresholds: Thresholds
    clips: tuple[GraphClip, ...]
    states: dict[str, StatePlace] = field(default_factory=dict)
    weights: tuple[Weight, ...] = ()
    transitions: tuple[Transition, ...] = ()
    refused: tuple[tuple[str, str, str], ...] = ()

    def __post_init__(self) -> None:
        names = self.names
        if len(set(names)) < len(names):
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise ValueError(f"clips: {shown(twice)} occurs twice")
        if len(names) > MOST_CLIPS or len(self.transitions) > MOST_TRANSITIONS:
            raise ValueError(f"more than {MOST_CLIPS} clips or {MOST_TRANSITIONS} transitions")
        pairs: list[Transition | Weight] = [*self.transitions, *self.weights]
        known, lengths = set(names), {clip.name: clip.duration + 1e-6 for clip in self.clips}
        for name in (*(p.before for p in pairs), *(p.after for p in pairs),
                     *(place.clip for place in self.states.values())):  # fmt: skip
            if name not in known:
                raise ValueError(f"no clip is called {shown(name)}")
        for t in self.transitions:
            if not (0.0 <= t.leave <= lengths[t.before] and 0.0 <= t.enter <= lengths[t.after]):
                raise ValueError(f"transitions: a time of {t.before!r} → {t.after!r} is not in it")
            if not (t.duration > 0.0 and t.coefficient >= 0.0):
                raise ValueError(f"transitions: {t.before!r} → {t.after!r} lasts or costs less "
                                 "than nothing")  # fmt: skip
        for name, place in self.states.items():
            if place.time > lengths[place.clip]:
                raise ValueError(f"states: {shown(name)} is not in the clip {place.clip!r}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the clips."""
        return tuple(clip.name for clip in self.clips)

    def between(self, before: str, after: str) -> tuple[Transition, ...]:
        """mc_ij: the transitions of a pair, the cheapest first; empty if there is none."""
        found = [t for t in self.transitions if (t.before, t.after) == (before, after)]
        return tuple(sorted(found, key=self.cost))

    def cost(self, transition: Transition) -> float:
        """w K + λ D, with w the expert's weight of the pair."""
        weight = self._factors.get((transition.before, transition.after)) or 1.0
        return weight * transition.coefficient + self.thresholds.time_price * transition.duration

    @cached_property
    def costs(self) -> np.ndarray:
        """(t,) `cost` of all transitions."""
        return np.array([self.cost(transition) for transition in self.transitions])

    @cached_property
    def _factors(self) -> dict[tuple[str, str], float | None]:
        return {(w.before, w.after): w.weight for w in self.weights}

    def without(self, refused: set[Transition]) -> MotionGraph:
        """The graph less some transitions."""
        if not refused:
            return self
        return replace(self, transitions=tuple(t for t in self.transitions if t not in refused))


@dataclass(frozen=True)
class _GraphFile:
    """The file of a graph: transitions as lists of six, to be short."""

    robot: str
    thresholds: Thresholds
    clips: tuple[GraphClip, ...]
    states: dict[str, StatePlace] = field(default_factory=dict)
    weights: tuple[Weight, ...] = ()
    transitions: tuple[Edge, ...] = ()
    refused: tuple[tuple[str, str, str], ...] = ()


def earliest_part(duration: float) -> float:
    """Until this time [s] a clip that is wanted is entered: in its first quarter."""
    return PART * duration


def latest_part(duration: float) -> float:
    """From this time [s] on it is left: in its last quarter."""
    return (1.0 - PART) * duration


HEADER = "# poise motion graph: before, after, leave [s], enter [s], duration [s], K\n"


def write_graph(graph: MotionGraph, path: str | Path) -> None:
    """Write a graph as YAML; raises ConfigError for another suffix, PoiseError if it cannot."""
    if Path(path).suffix not in (".yaml", ".yml"):
        raise ConfigError("must be the name of a .yaml file", source=path, choices=("*.yaml",))
    head = replace(graph, transitions=(), refused=())
    lines = [HEADER, *(line for line in to_yaml(head).splitlines(keepends=True)
                       if line not in ("transitions: []\n", "refused: []\n"))]  # fmt: skip
    edges = [(t.before, t.after, t.leave, t.enter, t.duration, t.coefficient)
             for t in graph.transitions]  # fmt: skip
    for name, rows in (("transitions", edges), ("refused", graph.refused)):
        lines += [f"{name}:{'' if rows else ' []'}\n", *(f"- {_flow(row)}" for row in rows)]
    write_atomic(path, "".join(lines))


def read_graph(path: str | Path) -> MotionGraph:
    """The graph in a file of `write_graph`.

    Raises ConfigError naming file and field: no such file, an unknown or missing field, a clip that
    is not there, a time that is not in a clip.
    """
    file = build(_GraphFile, read_yaml(path), path)
    transitions = tuple(Transition(*edge) for edge in file.transitions)
    values = {name: getattr(file, name) for name in file.__dataclass_fields__}
    try:
        return MotionGraph(**{**values, "transitions": transitions})
    except ValueError as error:
        raise ConfigError(str(error), source=path) from None


def _flow(row: Sequence[object]) -> str:
    rounded = [round(value, 6) if isinstance(value, float) else value for value in row]
    return yaml.safe_dump(rounded, default_flow_style=True, allow_unicode=True, width=10_000)
