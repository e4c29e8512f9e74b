"""A clip on a robot by any of the solvers, with constraints of the user's."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from scipy.ndimage import minimum_filter1d

from poise.baselines.balance.references.robot_clip import RATE, RobotClip, reference_from
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.clips.skeleton import SIDES
from poise.baselines.motion.retargeting.limbs import find_limbs
from poise.baselines.motion.retargeting.retarget import (
    ENOUGH,
    LEAD,
    SMOOTH,
    STEPPER,
    Holds,
    Retargeted,
    retarget_freely,
    retarget_to,
    targets_on,
)
from poise.baselines.motion.space_time.constraints.constraint import (
    Constraint,
    check_constraints,
    read_constraints,
)
from poise.baselines.motion.space_time.constraints.scene import Scene
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .tried import held_walk
from .walked import find_commands, walked_clip

IN_PLACE = "momentum-qp"  # performs motions without steps
Solver = Literal["frame", "spacetime", "grid"]
UNPERFORMED = ("feet", "heading", "contacts", "qpos")  # fields of errors that say so
COMES_DOWN, CLIMB = 1.5, 0.2  # [s] in which a foot is down; [legs] that the ground rises at least
KNEE = 0.12  # [legs] over the floor: a knee that is lower is on the ground
CROSSOVER = 2.0  # f [Hz], what is asked of the body faster than this is smoothed away


class RetargetedClip(NamedTuple):
    """A robot's clip, and what it misses.

    Attributes:
        clip: the postures, from standing to standing.
        quality: as `measure` finds it.
        solver: that made it.
        scale: the robot's legs over the clip's.
        time_per_frame: of the processor: of `frame` the median, of the others what they added,
            over the frames [s].
        stride: by which steps are shorter than the legs' scale has them; 1 without steps.
        begins: when the clip begins in the motion [s].
        tempo: how many times as fast as the clip it is.
        walker: the packaged controller or policy that performs it by walking; empty where none is
            needed.
        asked: commanded speed over the clip's at that tempo, since the walker is slower.
        flight: share of the time that the clip is in flight.
        bound: why it is slower, as of `Retargeted`; of what walks why it takes other steps.
        sunk, spread, held: as of `Retargeted`.
    """

    clip: RobotClip
    quality: Any  # Quality
    solver: Solver
    scale: float
    time_per_frame: float
    stride: float = 1.0
    begins: float = LEAD
    tempo: float = 1.0
    flight: float = 1.0
    bound: str = ""
    walker: str = ""
    asked: float = 1.0
    sunk: float = 0.0
    spread: float = 1.0
    held: bool = True

    @property
    def performer(self) -> str:
        """The controller that performs it; empty where none does."""
        if self.clip.about.unperformed:
            return ""
        return self.walker or (IN_PLACE if self.clip.planted is None else STEPPER)


def retarget_clip(
    clip: Clip | str | Path,
    robot: Robot,
    *,
    solver: Solver | None = None,
    constraints: str | Path | Sequence[Constraint] = (),
    smooth: float = SMOOTH,
    lead: float = LEAD,
    planted: bool = False,
    kinematic: bool | None = None,
    holds: Holds | None = None,
    progress: Callable[[str], None] | None = None,
) -> RetargetedClip:
    """A robot's motion of a clip: one that can be performed, else one that can be seen.

    With `kinematic` it is what `retarget_freely` makes, with False what `performable` makes; with
    None the latter. Where no controller could perform that, or its way or tempo are less than 0.7
    of the clip's, and nothing was asked with `solver`, `constraints` or `planted`, it is the
    former, with what `find_commands` has for a planner that walks. Of what is no faster so either,
    `about.unperformed` says why. `holds` is asked of motions with steps and of walks, as a trial of
    the controller that performs them: where one fails, they are slower, down to 0.7 of the clip's
    speed, steps are then walked if a planner takes the clip's own, and other ways to
    walk are tried (`held_walk`). A clip may be the
    name of a packaged one, or a path. All else, and what is raised, is as of these two.
    """
    clip = clip if isinstance(clip, Clip) else read_bvh(find_bvh(clip)).clip
    reason, stepped = "it was retargeted by kinematics alone (--kinematic)", None
    if not kinematic:
        asked = kinematic is not None or solver is not None or constraints or planted
        try:
            made = performable(
                clip, robot, solver=solver, constraints=constraints, smooth=smooth, lead=lead,
                planted=planted, holds=holds, progress=progress,
            )  # fmt: skip
            reference_from(made.clip, robot, clip.name)
            if asked or (made.held and made.stride * made.tempo >= ENOUGH):
                return made
            stepped = None if made.held else made
            reason = (f"{made.bound}; with {made.stride:.2f} of its way at {made.tempo:.2f} of its "
                      "tempo it can be done (--steps)")  # fmt: skip
        except ConfigError as error:
            reason = _climb(clip) or _kneels(clip) or error.message
            if asked or error.field not in UNPERFORMED:
                raise
    free = retarget_freely(clip, robot, smooth=smooth)
    walked, held = None, True
    seen = replace(free.clip, about=replace(free.clip.about, unperformed=reason))
    if not kinematic:
        try:
            found = find_commands(clip, robot, free.scale, ENOUGH)
            walks = walked_clip(free.clip, found, robot)
            reference_from(walks, robot, clip.name)
            if stepped is None or not found.bound:
                seen, walked = walks, found
                if holds is not None:
                    seen, walked, held = held_walk(clip, found, free, robot, holds)
        except ConfigError as error:
            if error.field == "speed" and not _kneels(clip):
                seen = replace(seen, about=replace(seen.about, unperformed=error.message))
    if stepped is not None and walked is None:
        return stepped
    scene = _scene(robot, find_limbs(robot), free.clip.qpos, 0.0, free.clip.planted)
    made = _stepped(free, scene)._replace(clip=seen)
    if walked is None:
        return made._replace(tempo=1.0)
    return made._replace(tempo=walked.tempo, walker=walked.walker, stride=walked.way,
                         asked=walked.asked, bound=walked.bound, held=held)  # fmt: skip


def _climb(clip: Clip) -> str:
    """What says that the feet of a clip do not come down to one level, within `COMES_DOWN`; empty
    where they do."""
    ankles = [clip.skeleton.joint(f"ankle_{side}", clip.name) for side in SIDES]
    lowest = clip.places()[:, ankles, 2].min(axis=1)
    size = 2 * int(0.5 * COMES_DOWN / clip.dt) + 1
    rise = float(np.ptp(minimum_filter1d(lowest, size, mode="nearest")))
    if rise < CLIMB * clip.skeleton.leg_length:
        return ""
    return f"its feet go up or down by {rise:.2f} m, and it can be performed on level ground alone"


def _kneels(clip: Clip) -> str:
    """What says that a knee of a clip is on the ground; empty where none is."""
    places, down = clip.places(), KNEE * clip.skeleton.leg_length + measure_contacts(clip).floor
    for side in SIDES:
        low = np.flatnonzero(places[:, clip.skeleton.joint(f"knee_{side}", clip.name), 2] < down)
        if low.size:
            return (f"its {side} knee is on the ground at {low[0] * clip.dt:.2f} s: robots stand "
                    "on their feet alone")  # fmt: skip
    return ""


def performable(
    clip: Clip,
    robot: Robot,
    *,
    solver: Solver | None = None,
    constraints: str | Path | Sequence[Constraint] = (),
    smooth: float = SMOOTH,
    lead: float = LEAD,
    planted: bool = False,
    holds: Holds | None = None,
    progress: Callable[[str], None] | None = None,
) -> RetargetedClip:
    """The postures in which a robot does what a clip shows, as `retarget` says, by a solver:

    ``frame``: frame by frame, without constraints; they are measured all the same. ``spacetime``:
    the optimum of the whole clip, begun at the result of ``frame``,

        min Σ ‖W e‖² + ρ Σ ‖x⃛‖² + Σ weight · excess,  ρ = (2π f)⁻⁶,

    with the soles where they are planted and joints within their limits; a constraint that cannot
    be met is missed by little in its L1 norm. ``grid``: constraints by trial in steps, keyframe by
    keyframe, as `by_trial` says.

    Args:
        clip: as for `retarget`. One with steps is for ``frame`` alone, without constraints.
        robot: with two feet.
        solver: without one, spacetime if there are constraints, else frame.
        constraints: the user's, or the name of a packaged file or a path to one.
        smooth: low-pass on what the clip asks for [Hz].
        lead: time from standing into the clip, and back [s].
        planted: take the feet as planted though they move in the clip.
        holds: what is asked of a motion with steps, see `retarget_clip`.
        progress: called with a line after every quadratic program.

    Raises:
        ConfigError: as `retarget`; a constraint of a point that the robot lacks, or a time that the
            clip lacks; another solver, or constraints, for a clip with steps.
        PoiseError: no posture keeps the soles and the limits; OSQP breaks down.
    """
    if solver is not None and solver not in get_args(Solver):
        raise ConfigError(f"no such solver: {solver!r}", field="solver", choices=get_args(Solver))
    if isinstance(constraints, (str, Path)):
        source: str | Path | None = constraints
        wanted = read_constraints(constraints)
    else:
        source, wanted = None, tuple(constraints)
    chosen: Solver = solver or ("spacetime" if wanted else "frame")
    given = targets_on(clip, robot, smooth=smooth, lead=lead, planted=planted)
    limbs, targets, steps = given
    if steps and (chosen != "frame" or wanted):
        raise ConfigError("its feet step: only the solver 'frame', without constraints, is for "
                          "such clips (--planted takes the feet as planted)", source=clip.name,
                          field="solver" if chosen != "frame" else "constraints")  # fmt: skip
    shape = np.tile(robot.standing_qpos, (len(targets), 1))
    check_constraints(wanted, _scene(robot, limbs, shape, lead), source)
    made = retarget_to(given, clip, robot, smooth=smooth, lead=lead, holds=holds)
    from .asked import Asked  # mink is there: `retarget_to` has used it
    from .grid import by_trial
    from .problem import Problem, optimise
    from .quality import motion_quality

    scene = _scene(robot, limbs, made.clip.qpos, lead, made.clip.planted, made.clip.dt)
    if steps:
        return _stepped(made, scene)
    asked = Asked(scene, targets, wanted)
    spent, begun = made.time_per_frame, time.thread_time()
    if chosen == "spacetime":
        optimise(Problem(scene, asked, wanted, CROSSOVER),
                 None if progress is None else lambda i, cost: progress(
                     f"program {i}: tasks {cost.tasks:.3f}, third derivative {cost.rough:.3f}, "
                     f"constraints {cost.lacking:.3f}"))  # fmt: skip
    elif chosen == "grid":
        by_trial(scene, asked, wanted)
    if chosen != "frame":
        spent = (time.thread_time() - begun) / len(scene)
    done = replace(made.clip, qpos=scene.qpos)
    quality = motion_quality(scene, asked, wanted)
    return RetargetedClip(done, quality, chosen, made.scale, spent, begins=made.begins)


def _stepped(made: Retargeted, scene: Scene) -> RetargetedClip:
    """Return a clip with steps, whose frames differ from the targets': hands are left out."""
    from .quality import measure_soles

    quality = measure_soles(scene, made.penetration, made.limit_excess, made.direction_error)
    return RetargetedClip(made.clip, quality, "frame", made.scale, made.time_per_frame, made.stride,
                          made.begins, made.tempo, made.flight, made.bound, sunk=made.sunk,
                          spread=made.spread, held=made.held)  # fmt: skip


def _scene(
    robot: Robot, limbs: Any, qpos: np.ndarray, lead: float, planted: np.ndarray | None = None,
    dt: float = RATE,
) -> Scene:  # fmt: skip
    """Postures `dt` [s] apart; soles that step are to stay where they land."""
    both = np.ones((len(qpos), 2), dtype=bool)
    scene = Scene(robot, limbs, qpos, dt, lead, both if planted is None else planted)
    if planted is None:
        return scene
    for frame in range(len(scene)):
        scene.at(frame)
        for foot in range(2):
            if frame and planted[frame, foot] and planted[frame - 1, foot]:
                scene.planted_corners[frame, foot] = scene.planted_corners[frame - 1, foot]
            elif planted[frame, foot]:
                scene.planted_corners[frame, foot] = scene.padded_corners(foot)
    return scene
