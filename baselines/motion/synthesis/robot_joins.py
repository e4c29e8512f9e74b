"""The joins of a robot's clips: ways that it can do, each found once."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import FEWEST, About, RobotClip, reference_from
from poise.baselines.balance.references.stances import why_not_home
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.feasibility.check import FeasibilityLimits
from poise.baselines.motion.feasibility.curve import End, JoinPart, WhyNot
from poise.baselines.motion.feasibility.physical import (
    JoinRefused,
    direct_way,
    height_span,
    make_shaper,
    pause,
    standing_end,
    ways_by_standing,
)
from poise.baselines.motion.feasibility.shape import NEIGHBOURS, Shaper
from poise.baselines.motion.graphs.motion_graph import Transition
from poise.baselines.motion.retargeting.performed import STILL, planted_qpos
from poise.baselines.motion.retargeting.robot_bvh import clip_of_robot, robot_qpos
from poise.configs.errors import PoiseError
from poise.envs.robots.robot import Robot

LED = 30  # frames at an end of a motion that say how it begins or ends


@dataclass(frozen=True, eq=False)
class Way:
    """How one clip is led into another one.

    Attributes:
        clip: from the posture that is left to the one that is entered, both included.
        parts: one, or two with standing between them.
    """

    clip: Clip
    parts: tuple[JoinPart, ...]

    def record(self) -> dict[str, Any]:
        """Return its figures, as plain values: durations [s], ZMP [m], torque over its limit."""
        judged = [part.feasibility for part in self.parts]
        return {
            "durations": [part.duration for part in self.parts],
            "coefficient": sum(part.coefficient for part in self.parts),
            "bent": any(part.bent for part in self.parts),
            "through_standing": len(self.parts) > 1,
            "zmp_inside": min(float(one.zmp_margin.min()) for one in judged),
            "torque": max(float(one.torque.max()) for one in judged),
        }


class _Side(NamedTuple):
    """A clip, or what of it is without a step about a time, as joins see it.

    Attributes:
        motion: of the frames.
        joints: (F, nj) of them.
        begin: time in the clip [s].
    """

    motion: ReferenceMotion
    joints: np.ndarray
    begin: float = 0.0


class RobotJoins:
    """Ways between clips of one robot's skeleton, see `physical_join`.

    What has been looked for is remembered by the names of clips and the times in them.

    Args:
        robot: whose clips they are.
        limits: what the ways keep.
    """

    def __init__(self, robot: Robot, limits: FeasibilityLimits | None = None):
        self.robot, self.limits = robot, limits
        self._sides: dict[tuple[str, int], _Side | str] = {}
        self._ways: dict[tuple[Transition, bool], Way | str] = {}

    def refusal(
        self, before: Clip, after: Clip, transition: Transition, through: bool = False
    ) -> str:
        """Why the robot cannot do a transition, or nothing; `through` standing if need be."""
        made = self._known(before, after, transition, through)
        return made if isinstance(made, str) else ""

    def way(self, before: Clip, after: Clip, transition: Transition) -> Way:
        """The way of a transition, direct if there is one; raises JoinRefused if there is none."""
        made = self._known(before, after, transition, through=True)
        if isinstance(made, str):
            raise JoinRefused(f"no way from {before.name!r} at {transition.leave:.2f} s to "
                              f"{after.name!r} at {transition.enter:.2f} s: {made}")  # fmt: skip
        return made

    def lead(self, clip: Clip, first: bool) -> Way | None:
        """The way from standing into a motion, or from it back; None where it needs none.

        Raises JoinRefused if the robot cannot begin or end so.
        """
        word = "begin from" if first else "end in"
        if said := self.away(clip, first):
            raise JoinRefused(f"the motion cannot {word} standing: {said}")
        side = self._made_side(_piece(clip, first))
        gap = np.abs(side.joints[0 if first else -1] - self.robot.standing_qpos[7:])
        if gap.max() <= STILL:
            return None
        shaper = self._shaper(clip.dt, (side,))
        here = _end(shaper, side, 0.0 if first else side.motion.duration, entered=first)
        standing = standing_end(shaper)
        pair = (standing, here) if first else (here, standing)
        made = self._direct(shaper, *pair)
        if isinstance(made, str):
            raise JoinRefused(f"the motion cannot {word} standing: {made}")
        return made

    def away(self, clip: Clip, first: bool) -> str:
        """Why a clip with steps cannot be joined at its begin, or its end; nothing if it can."""
        frame = 0 if first else len(clip) - 1
        if clip.support is None or clip.support.home[frame]:
            return ""
        qpos = robot_qpos(clip.part(slice(frame, frame + 1)), self.robot)[0]
        said = why_not_home(self.robot, qpos, clip.support.planted[frame])
        return f"at {frame * clip.dt:.2f} s of {clip.name!r} {said}"

    def _known(self, before: Clip, after: Clip, transition: Transition, through: bool) -> Way | str:
        """The way of a transition, or why there is none; looked for once."""
        key = (transition, through)
        if key not in self._ways:
            self._ways[key] = self._found(before, after, transition, through)
        return self._ways[key]

    def _found(self, before: Clip, after: Clip, transition: Transition, through: bool) -> Way | str:
        direct = self._known(before, after, transition, False) if through else ""
        if isinstance(direct, Way):
            return direct
        sides = self._side(before, transition.leave), self._side(after, transition.enter)
        a, b = sides
        if isinstance(a, str) or isinstance(b, str):
            return a if isinstance(a, str) else str(b)
        shaper = self._shaper(before.dt, (a, b))
        ends = (_end(shaper, a, transition.leave, entered=False),
                _end(shaper, b, transition.enter, entered=True))  # fmt: skip
        if not through:
            return self._direct(shaper, *ends)
        found = ways_by_standing(shaper, *ends)
        if isinstance(found, str):
            return f"{direct}; {found}"
        return self._way(shaper, *ends, found)

    def _direct(self, shaper: Shaper, a: End, b: End) -> Way | str:
        found = direct_way(shaper, a, b)
        return found.reason if isinstance(found, WhyNot) else self._way(shaper, a, b, (found,))

    def _way(self, shaper: Shaper, a: End, b: End, parts: tuple[JoinPart, ...]) -> Way:
        joints = np.vstack([a.q, *pause(shaper, parts), b.q])
        qpos = np.array([shaper.planted.placed(q) for q in joints])
        clip = clip_of_robot(self.robot, qpos, shaper.dt, "physical")
        return Way(clip, parts)

    @cached_property
    def _first_shaper(self) -> Shaper:
        return make_shaper(self.robot, 1.0, [load_motion("standing", self.robot)], self.limits)

    def _shaper(self, dt: float, sides: tuple[_Side, ...]) -> Shaper:
        span = height_span([side.motion for side in sides])
        return replace(self._first_shaper, dt=dt, heights=span)

    def _side(self, clip: Clip, time: float) -> _Side | str:
        """What there is of a clip about a time [s]; or why it is nothing that can be joined."""
        run = slice(0, len(clip))
        if clip.support is not None:
            frame = min(round(time / clip.dt), len(clip) - 1)
            run = clip.support.run(frame)
            if run.stop <= frame:
                part = clip.part(slice(0, frame + 1))
                return self.away(part, first=False)
        key = (clip.name, run.start)
        if key not in self._sides:
            try:
                self._sides[key] = self._made_side(clip.part(run), run.start * clip.dt)
            except PoiseError as error:
                self._sides[key] = str(error)
        return self._sides[key]

    def _made_side(self, clip: Clip, begin: float = 0.0) -> _Side:
        """Raises PoiseError for what the robot cannot follow, soles off the ground for one."""
        if len(clip) < FEWEST:
            raise PoiseError(f"{clip.name!r} has fewer than {FEWEST} frames")
        if clip.support is None:
            qpos = planted_qpos(clip, self.robot)
        else:
            placed = self._first_shaper.planted.placed
            qpos = np.array([placed(q[7:]) for q in robot_qpos(clip, self.robot)])
        about = About(self.robot.name, self.robot.fingerprint, clip.name)
        motion = reference_from(RobotClip(about, clip.dt, qpos), self.robot, clip.name, rest=False)
        return _Side(motion, qpos[:, 7:], begin)


def _end(shaper: Shaper, side: _Side, time: float, entered: bool) -> End:
    """Return the end of a side at a time [s], with the frames next to it."""
    time, steps = max(time - side.begin, 0.0), np.arange(NEIGHBOURS) * shaper.dt
    times = time + steps if entered else time - steps[::-1]
    kept = times[(times > -1e-9) & (times < side.motion.duration + 1e-9)]
    frames = np.array([side.motion.sample(t).q_ref for t in np.maximum(kept, 0.0)])
    return shaper.end(side.motion, min(time, side.motion.duration), frames)


def _piece(clip: Clip, first: bool) -> Clip:
    """The frames at one end of a motion."""
    run = slice(0, len(clip))
    if clip.support is not None:
        run = clip.support.run(0 if first else len(clip) - 1)
    least, most = (run.start, run.start + LED) if first else (run.stop - LED, run.stop)
    return clip.part(slice(max(least, run.start), min(most, run.stop)))
