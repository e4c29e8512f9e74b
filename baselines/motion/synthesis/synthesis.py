"""A script and a graph become one clip, with a record of every choice."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

from poise.baselines.motion.clips.clip import Clip, together
from poise.baselines.motion.graphs.frames import nearest_places
from poise.baselines.motion.graphs.joining.joins import JOINS, laid_on
from poise.baselines.motion.graphs.motion_graph import (
    MotionGraph,
    Transition,
    earliest_part,
    latest_part,
)
from poise.baselines.motion.graphs.paths import Path, PathTask, Place, Step
from poise.baselines.motion.graphs.search import best_paths
from poise.baselines.motion.retargeting.performed import planned_again
from poise.baselines.motion.synthesis.scripts.printer import text_of
from poise.baselines.motion.synthesis.scripts.tree import Script, StateName
from poise.configs.errors import ConfigError, shown

from .actions import Actions, Reader
from .plan import PHYSICAL, MotionPart, Plan, lead_part
from .robot_joins import RobotJoins
from .stage import LONGEST, Stage


class Synthesis:
    """The way from a script to a clip.

    Args:
        graph: clips and transitions.
        clips: name → clip, of all that the graph has.
        kind: of transitions that the script leaves open.
        robot_joins: of the robot whose clips they are, for transitions of the kind `physical`. Of
            these the ones of the best path are made first; what the robot cannot do is gone round,
            or by standing where there is no other way.
        others: clips that are not loaded, for errors.
    """

    def __init__(
        self,
        graph: MotionGraph,
        clips: Mapping[str, Clip],
        kind: str = "insert",
        robot_joins: RobotJoins | None = None,
        others: Iterable[str] = (),
    ):
        self.kinds = (*JOINS, *([PHYSICAL] if robot_joins else []))
        if kind not in self.kinds:
            raise ConfigError(f"no transition {shown(kind)} here", field="kind", choices=self.kinds)
        self.stage = Stage(graph, dict(clips), others)
        self.kind, self.robot_joins = kind, robot_joins

    def plan(self, script: Script, k: int = 1) -> Plan:
        """The k best paths; what the script makes of clips becomes part of the stage.

        Raises ConfigError with line and column, or for a script that has no way.
        """
        reader = Reader(
            script,
            self.stage,
            lambda inner: self._play(self._plan(inner, 1, script))[0],
            self._again,
        )
        actions = reader.actions()
        return self._plan(actions, k, script)

    def make(self, script: Script, plan: Plan | None = None) -> tuple[Clip, dict[str, Any]]:
        """The clip of the best path, and the record of what was chosen, as plain values."""
        plan = self.plan(script) if plan is None else plan
        clip, parts = self._play(plan)
        if self.kind == PHYSICAL:
            clip, parts = self._led(clip, parts)
        return clip, {
            "script": text_of(script),
            "robot": self.stage.graph.robot,
            "duration": clip.duration,
            "cost": plan.paths[0].cost,
            "made": sorted(self.stage.derived),
            "parts": [asdict(part) for part in parts],
            "others": [{"cost": path.cost, "clips": [step.clip for step in path.steps]}
                       for path in plan.paths[1:]],
        }  # fmt: skip

    def _again(self, clip: Clip) -> Clip:
        """A clip after a change: what has steps is planned again for them."""
        if clip.support is None or self.robot_joins is None:
            return clip
        return planned_again(clip, self.robot_joins.robot)

    def _plan(self, actions: Actions, k: int, script: Script) -> Plan:
        arrows, kinds = {}, {}
        self._check_steps(actions, script)
        for i, arrow in enumerate(actions.arrows):
            if not arrow.kind:
                continue
            arrows[i], kinds[i] = self._by_hand(actions, i, script), arrow.kind
        ends = [self._places(state, script) for state in (actions.start, actions.goal)]
        task = PathTask(actions.names, arrows, *ends)
        try:
            paths = self._best_paths(task, k)
        except ConfigError as error:
            raise ConfigError(error.message, source=script.source, choices=error.choices) from None
        return Plan(actions, tuple(paths), kinds)

    def _check_steps(self, actions: Actions, script: Script) -> None:
        """Raise ConfigError for clips with steps that no transition can lead to, or on from."""
        joins = self.robot_joins
        for i, name in enumerate(actions.names):
            clip = self.stage.clips[name]
            if clip.support is None or joins is None:
                continue
            if len(actions.names) > 1 and self.kind != PHYSICAL:
                raise ConfigError(f"{shown(name)} has steps, which {self.kind} does not support: "
                                  f"only {PHYSICAL} joins it", source=script.source)  # fmt: skip
            for first, needed in ((True, i > 0), (False, i + 1 < len(actions.names))):
                times = clip.times[clip.support.home]
                late, early = latest_part(clip.duration), earliest_part(clip.duration)
                free = (times <= early) if first else (times >= late)
                if needed and not free.any():
                    word = "lead to" if first else "follow"
                    said = f"nothing can {word} {shown(name)}: {joins.away(clip, first)}"
                    raise ConfigError(said, source=script.source)  # fmt: skip

    def _by_hand(self, actions: Actions, i: int, script: Script) -> Transition:
        """The transition of the arrow after action `i`; an error says where the arrow stands."""
        arrow = actions.arrows[i]
        said = f"no transition {shown(arrow.kind)} here" if arrow.kind not in self.kinds else ""
        duration = dict(arrow.options).get("duration")
        made = self.stage.by_hand(actions.names[i], actions.names[i + 1], duration)
        steps = [name for name in actions.names[i : i + 2] if self.stage.clips[name].support]
        if steps and arrow.kind != PHYSICAL and not said:
            said = f"{shown(steps[0])} has steps: only {PHYSICAL} joins it"
        if arrow.kind == PHYSICAL and not said:
            said = self._refusal(made, through=True)
            if duration is not None:
                said = "a physical transition lasts as long as the robot needs"
        if said:
            choices = self.kinds if said.startswith("no transition") else None
            raise script.wrong(said, arrow.at, choices)
        return made

    def _best_paths(self, task: PathTask, k: int) -> list[Path]:
        """Ways of which every transition can be made; by standing if there is no other one."""
        graph = self.stage.graph
        if self.kind != PHYSICAL:
            return best_paths(graph, task, k)
        try:
            return best_paths(graph, task, k, lambda t: self._refusal(t, through=False))
        except ConfigError:
            return best_paths(graph, task, k, lambda t: self._refusal(t, through=True))

    def _refusal(self, transition: Transition, through: bool) -> str:
        """Why a physical transition cannot be made, or nothing."""
        assert self.robot_joins is not None  # or there is no such kind
        before, after = (self.stage.clips[name] for name in (transition.before, transition.after))
        return self.robot_joins.refusal(before, after, transition, through)

    def _places(self, state: StateName | None, script: Script) -> dict[Place, float]:
        if state is None:
            return {}
        place = self.stage.place(state, script)
        posture = self.stage.posture(place.clip, place.time)
        with script.blamed(state.at):
            return nearest_places(self.stage.frames, posture,
                                  price=self.stage.graph.thresholds.time_price)  # fmt: skip

    def _play(self, plan: Plan) -> tuple[Clip, list[MotionPart]]:
        """The steps of the best path, one after the other."""
        steps = plan.paths[0].steps
        seconds = sum(s.leave - s.enter + (s.after.duration if s.after else 0.0) for s in steps)
        if seconds > 2.0 * LONGEST:  # joins that overlap take time away, at most half
            raise self._too_long()
        last, done = self._part(steps[0]), list[Clip]()
        parts = [MotionPart(steps[0].clip, 0.0, last.duration, *steps[0][1:4])]
        number, kind, frames = 0 if steps[0].wanted else -1, self.kind, 0
        for before, step in pairwise(steps):
            transition, part = before.after, self._part(step)
            assert transition is not None
            kind = plan.kinds.get(number, self.kind) if before.wanted else self.kind
            number += step.wanted
            both, physics = self._joined(kind, last, part, transition)
            seam = len(both) - len(part)
            head, last = both.part(slice(0, seam)), both.part(slice(seam, None))
            done.append(head)
            frames += len(head)
            begins = frames * last.dt
            ends = sorted((parts[-1].ends, begins))
            parts += [
                MotionPart(kind, ends[0], ends[1], transition.leave, transition.enter, False,
                       transition.coefficient, physics),
                MotionPart(step.clip, begins, begins + part.duration, *step[1:4]),
            ]  # fmt: skip
        whole = together([*done, last])
        if whole.duration > LONGEST:
            raise self._too_long()
        return replace(whole, name=plan.actions.names[0]), parts

    def _joined(
        self, kind: str, last: Clip, part: Clip, transition: Transition
    ) -> tuple[Clip, dict[str, Any] | None]:
        """What has been made so far, a transition and the clip that follows."""
        if kind != PHYSICAL:
            return JOINS[kind](last, part, transition.duration), None
        assert self.robot_joins is not None
        clips = self.stage.clips
        way = self.robot_joins.way(clips[transition.before], clips[transition.after], transition)
        between, part = (clip if clip.dt == last.dt else clip.resampled(last.dt)
                         for clip in (way.clip, part))  # fmt: skip
        return laid_on(laid_on(last, between), part), way.record()

    def _led(self, clip: Clip, parts: list[MotionPart]) -> tuple[Clip, list[MotionPart]]:
        """From standing to standing, by ways that the robot can do."""
        assert self.robot_joins is not None
        into, back = (self.robot_joins.lead(clip, first) for first in (True, False))
        if into is not None:
            clip = replace(laid_on(into.clip, clip), name=clip.name, licence=clip.licence)
            late = into.clip.duration
            parts = [replace(p, begins=p.begins + late, ends=p.ends + late) for p in parts]
            parts = [lead_part(into, 0.0), *parts]
        if back is not None:
            parts = [*parts, lead_part(back, clip.duration)]
            clip = laid_on(clip, back.clip)
        return clip, parts

    def _too_long(self) -> ConfigError:
        return ConfigError(f"lasts longer than {LONGEST:g} s", source="script")

    def _part(self, step: Step) -> Clip:
        """A clip from one time to another, at least two frames of it."""
        clip, enter, leave = self.stage.clips[step.clip], step.enter, step.leave
        if leave - enter < 1.5 * clip.dt:
            enter = min(enter, clip.duration - clip.dt)
            leave = enter + clip.dt
        return clip.cut(enter, leave)
