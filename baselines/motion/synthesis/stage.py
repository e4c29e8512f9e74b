"""The clips that a script plays: those of a graph, and those that it makes of them on the way."""

from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.link_groups import GROUPS
from poise.baselines.motion.graphs.adjacency import end_to_begin, with_clip
from poise.baselines.motion.graphs.frames import Frames, frames_of
from poise.baselines.motion.graphs.joining.overlay import Layer, overlay
from poise.baselines.motion.graphs.motion_graph import (
    GraphClip,
    MotionGraph,
    StatePlace,
    Transition,
)
from poise.baselines.motion.synthesis.scripts.printer import body_text
from poise.baselines.motion.synthesis.scripts.tree import Modifier, Script, StateName
from poise.configs.errors import ConfigError, shown

LONGEST = 600.0  # [s] of a clip and of a whole motion
HELD = 0.3  # [s] of rest in a posture


class Stage:
    """A graph, its clips and their frames; grows by what scripts derive.

    Attributes:
        graph: with a node for every clip.
        clips, frames: name → clip; name → its frames.
        derived: the clips that scripts made, named by their text.
        others: clips that there are, too, and that are not loaded.
    """

    def __init__(self, graph: MotionGraph, clips: dict[str, Clip], others: Iterable[str] = ()):
        missing = [name for name in graph.names if name not in clips]
        if missing:
            raise ConfigError(f"the clip {missing[0]!r} is not loaded", source="graph")
        self.graph = graph
        self.clips = {name: clips[name] for name in graph.names}
        self.frames = {name: self._frames(name, clip) for name, clip in self.clips.items()}
        self.packed, self.others = graph.names, tuple(others)
        self.derived: set[str] = set()

    def _frames(self, name: str, clip: Clip) -> Frames:
        return frames_of(clip, planted=True if self.graph.robot else None)._replace(name=name)

    def find(self, name: str) -> str | None:
        """The clip of a name, see `whole_name`; None if there is none."""
        return whole_name(name, self.packed)

    def add(self, text: str, clip: Clip) -> None:
        """Make a derived clip a node of the graph."""
        if clip.duration > LONGEST:
            raise ConfigError(f"lasts {clip.duration:.0f} s, at most {LONGEST:g} s are made")
        self.clips[text] = replace(clip, name=text)
        self.frames[text] = self._frames(text, self.clips[text])
        self.graph = with_clip(self.graph, GraphClip(text, "", clip.duration), self.frames)
        self.derived.add(text)

    def by_hand(self, before: str, after: str, duration: float | None) -> Transition:
        """The transition from end to begin, of a duration [s] or of the best one."""
        limits = self.graph.thresholds
        if duration is not None:
            limits = replace(limits, least=duration, most=duration)
        made = end_to_begin(self.frames[before], self.frames[after], limits)
        lengths = {clip.name: clip.duration for clip in self.graph.clips}
        return replace(made, leave=lengths[before])

    def place(self, state: StateName, script: Script) -> StatePlace:
        """Where a posture is: a state of the graph, or a clip at a time, from its first frame on.

        Raises ConfigError with line and column: there is neither, or the clip ends before.
        """
        known = self.graph.states.get(state.name) if state.time is None else None
        if known is not None:
            return known
        name, time = self.find(state.name), state.time or 0.0
        if name is None:
            choices = [*(self.graph.states if state.time is None else ()), *self.packed]
            raise script.wrong(f"no posture {shown(state.name)}", state.at, choices)
        if time > self.clips[name].duration:
            raise script.wrong(f"{shown(name)} lasts {self.clips[name].duration:.2f} s",
                               state.at)  # fmt: skip
        return StatePlace(name, time)

    def hold(self, state: StateName, script: Script) -> str:
        """The clip, `HELD` long, that rests in a posture."""
        text = body_text(state)
        if text not in self.derived:
            place = self.place(state, script)
            clip = self.clips[place.clip]
            frame = min(round(place.time / clip.dt), len(clip) - 1)
            with script.blamed(state.at):
                self.add(text, clip.part(np.full(round(HELD / clip.dt) + 1, frame)))
        return text

    def posture(self, name: str, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Height (3,) and rotations (J, 4) of a clip at a time [s], facing x."""
        clip = self.clips[name]
        frame = min(round(time / clip.dt), len(clip) - 1)
        pair = clip.cut(max(frame - 1, 0) * clip.dt, max(frame, 1) * clip.dt)
        frames = frames_of(pair, pair.dt)
        index = -1 if frame else 0
        return frames.heights[index], frames.rotations[index]


def whole_name(name: str, names: Collection[str]) -> str | None:
    """Return the one of `names`, or the only one of them that ends in `_name`; None without one."""
    if name in names:
        return name
    ends = [full for full in names if full.endswith(f"_{name}")]
    return ends[0] if len(ends) == 1 else None


def changed(clip: Clip, modifier: Modifier, script: Script) -> Clip:
    """A clip after one modifier; an error says where the modifier stands."""
    with script.blamed(modifier.at):
        if modifier.kind == "[":
            clip = clip.cut(*modifier.numbers)
            if clip.support is not None and not clip.support.planted[[0, -1]].all():
                raise ConfigError("cuts a step: both soles must be planted there")
            return clip
        if modifier.kind == "@":
            return clip.at_speed(modifier.numbers[0])
        if modifier.kind == "mirrored":  # on the same bones: sides may differ by a millimetre
            return replace(clip.mirrored(), skeleton=clip.skeleton)
    raise script.wrong(f'"{modifier.kind}" is for what lies over another motion: a | b '
                       f"{modifier.kind} …", modifier.at)  # fmt: skip


def layer_of(clip: Clip, modifiers: tuple[Modifier, ...], script: Script) -> Layer:
    """A layer by its `on` and `weight`."""
    groups, weight = [], None
    for modifier in modifiers:
        if modifier.kind == "weight":
            weight = modifier.numbers[0]
        for name in modifier.names:
            if name not in GROUPS:
                raise script.wrong(f"no link group {shown(name)}", modifier.at, GROUPS)
            groups.append(GROUPS[name])
    return Layer(clip, tuple(groups), weight)


def overlaid_clip(base: Clip, layers: list[Layer], at: int, script: Script) -> Clip:
    """The base under its layers; an error says where the overlay stands."""
    try:
        return overlay(base, layers)
    except ConfigError as error:
        raise script.wrong(error.message, at, error.choices) from None
