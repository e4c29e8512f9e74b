"""A clip of any skeleton as a motion of a robot: its soles stay planted, or step as the clip's."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from poise.baselines.balance.references.footing import sole_poses
from poise.baselines.balance.references.footwork import NotReached, perform_plan
from poise.baselines.balance.references.robot_clip import RATE, About, RobotClip
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.configs.errors import ConfigError
from poise.configs.extras import needing
from poise.envs.robots.robot import Robot

from .leaps import FLIGHTS, STANDS, WAYS, Leap, find_leaps, plan_leaps, tempo_of
from .limbs import Limbs, find_limbs
from .paces import SWINGING, find_paces, frames_before, plan_paces
from .targets import BodyTargets, between_standing, clip_targets, standing_targets
from .tracks import find_tracks, first_heading

SMOOTH = 3.0  # [Hz] of the low-pass on what the clip asks for, and on the joints
LEAD = 1.0  # [s] from standing into the clip, and back
SHORTER, SHORTEST = 0.94, 0.3  # by which ways are shortened until legs reach, and the end of that
#: the robot's limbs, what they are to do from standing to standing, and whether the feet step
AskedOf = tuple[Limbs, BodyTargets, bool]
STEPPER = "motion-step"  # the controller that performs motions with steps


class Rehearsed(NamedTuple):
    """Trials of a controller that performs a motion.

    Attributes:
        share: of the trials until the first one in which it falls, or a planner of its own takes
            the steps; 1: in none.
        kept: mean share of the motion's steps that were taken; 1 of a motion without steps.
    """

    share: float
    kept: float = 1.0


Holds = Callable[[RobotClip, str], Rehearsed]
#: shares of the clip's lengths of steps and of its tempo, the fastest first
TRIED = sorted(
    [(stride, 1.0) for stride in (1.0, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.5, 0.4)]
    + [(stride, tempo) for stride in (1.0, 0.9, 0.8) for tempo in (0.85, 0.7)],
    key=lambda each: -each[0] * each[1],
)
LOWER = (0.98, 0.965, 0.95, 0.935)  # heights of the CoM over standing that steps are tried at
#: where no steps at `ENOUGH` of the clip's speed are found: lower by up to so much where legs do
#: not reach [m]; shares of the clip's width of steps, and low-pass on trunk and arms [Hz]
SINK, GIVING = 0.04, ((1.0, 1.5), (1.0, 0.9), (0.5, 0.9))
NEARLY = 0.06  # [m, rad] that may lack for that
ENOUGH = 0.7  # of the clip's speed: what is slower is not taken for the clip
OFF = 0.003  # [m] by which a planted sole may be off
SWIFTER = 2.0  # times `smooth` is what is kept of a motion that need not be performed


class Retargeted(NamedTuple):
    """The robot's clip and how well it met what was asked.

    Attributes:
        clip: the postures, from standing to standing.
        scale: the robot's legs over the clip's.
        sole_error, direction_error, penetration, time_per_frame: as in `Solved`.
        limit_excess: largest excess over a joint limit [rad]; 0 if there is none.
        stride: by which steps are shorter than the legs' scale has them; 1 without steps.
        begins: when the clip begins in the motion [s].
        tempo: how many times as fast as the clip it is.
        flight: share of the time that the clip is in flight.
        bound: what keeps it from 0.7 of the clip's speed; empty where nothing does.
        sunk: by how much the CoM is lower than planned where legs would not reach [m].
        spread: share of the clip's width of steps that is kept.
        held: False where a trial failed of every motion that `holds` was asked of.
    """

    clip: RobotClip
    scale: float
    sole_error: float
    direction_error: dict[str, float]
    penetration: float
    time_per_frame: float
    limit_excess: float
    stride: float = 1.0
    begins: float = LEAD
    tempo: float = 1.0
    flight: float = 1.0
    bound: str = ""
    sunk: float = 0.0
    spread: float = 1.0
    held: bool = True


def retarget(
    clip: Clip, robot: Robot, *, smooth: float = SMOOTH, lead: float = LEAD, planted: bool = False
) -> Retargeted:
    """The postures in which a robot does what a clip shows, its soles planted where the clip's are.

    Per frame: directions of pelvis, trunk, shoulders and arms as in the clip; the hips' height in
    proportion to the legs; the CoM over its place; the soles fixed; the joints within their limits;
    links off the floor and off each other. Where the clip's feet move by 12 cm, trunk and arms are
    those, the feet step as in `paces.py`, and the CoM goes where they can bear it.

    Args:
        clip: whose hips, knees, ankles, shoulders, elbows and wrists are known by name.
        robot: with two feet; without arms their part is left out.
        smooth: low-pass [Hz].
        lead: time from standing into the clip, and back [s].
        planted: take the feet as planted though they move in the clip.

    Raises:
        ConfigError: feet that fly, or steps that the legs cannot do (without `planted`);
            unknown joints, fewer than 8 frames, a `smooth` or `lead` that is not above 0, mink is
            missing.
        PoiseError: no posture keeps the soles and the limits.
    """
    asked = targets_on(clip, robot, smooth=smooth, lead=lead, planted=planted)
    return retarget_to(asked, clip, robot, smooth=smooth, lead=lead)


def retarget_to(
    asked: AskedOf, clip: Clip, robot: Robot, *, smooth: float, lead: float,
    holds: Holds | None = None,
) -> Retargeted:  # fmt: skip
    """`retarget` for what `targets_on` has found with the same arguments; raises what it does.

    Steps are slower where a trial of them by `holds` fails; where one always does, they are the
    fastest.
    """
    limbs, whole, steps = asked
    if steps and (leaps := find_leaps(clip)):
        return _leaping(leaps, clip, robot, limbs, smooth, lead)
    if steps:
        return _stepped(clip, robot, limbs, smooth, lead, holds)
    with needing("motion", "motion"):
        from .solve import solve_frames
    solved = solve_frames(robot, limbs, whole, smooth)
    return _retargeted(solved, clip, robot, limbs, begins=lead)


def _retargeted(
    solved: Any, clip: Clip, robot: Robot, limbs: Limbs, *, planted: np.ndarray | None = None,
    stride: float = 1.0, begins: float = 0.0,
) -> Retargeted:  # fmt: skip
    joints, (low, high) = solved.qpos[:, 7:], robot.joint_range.T
    about = About(robot.name, robot.fingerprint, clip.name, clip.name, clip.licence)
    return Retargeted(
        RobotClip(about, RATE, solved.qpos, planted),
        limbs.leg_length / clip.skeleton.leg_length,
        solved.sole_error,
        solved.direction_error,
        solved.penetration,
        solved.time_per_frame,
        float(max(np.maximum(low - joints, joints - high).max(), 0.0)),
        stride,
        begins,
    )


def targets_on(clip: Clip, robot: Robot, *, smooth: float, lead: float, planted: bool) -> AskedOf:
    """Return the targets of a clip on a robot; arguments and errors as of `retarget`."""
    for name, value in (("smooth", smooth), ("lead", lead)):
        if not 0.0 < value <= 100.0:
            raise ConfigError(f"must be above 0 and at most 100, not {value:g}", field=name)
    steps = not planted and not measure_contacts(clip).in_place
    limbs = find_limbs(robot)
    targets = clip_targets(clip, limbs.has_arms, smooth, first_heading(clip) if steps else None)
    whole = between_standing(targets, standing_targets(limbs), lead)
    return limbs, whole, steps


def _stepped(
    clip: Clip, robot: Robot, limbs: Limbs, smooth: float, lead: float, holds: Holds | None
) -> Retargeted:
    """The fastest motion up to the clip's that the robot can do, and that holds: steps and tempo as
    of `TRIED`, the CoM as high as legs reach then."""
    paces, scale = find_paces(clip), limbs.leg_length / clip.skeleton.leg_length
    with needing("motion", "motion"):
        from .solve_tracks import solve_tracks
    frames = max(round(lead / RATE), 1)
    solved: dict[float, Any] = {}
    reason, bound = None, ""

    def made_of(trial: RetargetTrial) -> Retargeted:
        """The motion of a trial; raises ConfigError as `perform_plan`."""
        tempo = trial.tempo
        slower = clip if tempo == 1.0 else clip.at_speed(tempo)
        tracks = find_tracks(slower, robot, limbs, smooth, trial.stride, trial.spread)
        if tempo not in solved:
            solved[tempo] = solve_tracks(robot, limbs, tracks, smooth)
        timed = [pace.at_speed(tempo) for pace in paces]
        plan = plan_paces(timed, tracks, solved[tempo].qpos, robot, frames, scale, trial.low,
                          trial.calm)  # fmt: skip
        qpos = perform_plan(robot, plan, clip.name, trial.sink)
        sunk = float((plan.height - sole_poses(robot, qpos)[0][:, 2]).max()) if trial.sink else 0.0
        made = _retargeted(solved[tempo]._replace(qpos=qpos), clip, robot, limbs,
                           planted=plan.planted, stride=trial.stride,
                           begins=RATE * frames_before(timed, frames))  # fmt: skip
        return made._replace(tempo=tempo, sunk=sunk, spread=trial.spread)

    slow: Retargeted | None = None
    first: Retargeted | None = None  # the fastest of those that do not hold
    tried: set[tuple[float, float]] = set()  # ways of those
    lacks: dict[tuple[float, float], float] = {}  # by way: what is lacking, at the lowest CoM
    for trial in _trials():
        if trial.way in tried:
            continue
        if trial.sink and (first is not None or lacks.get(trial.way, np.inf) > NEARLY):
            continue
        if (slow or first) is not None and trial.stride * trial.tempo < ENOUGH:
            continue  # the fastest of these was found before
        try:
            made = made_of(trial)
        except ConfigError as error:
            reason = error
            if trial.stride * trial.tempo >= ENOUGH and not trial.sink:
                bound = error.message
                lacks[trial.way] = error.by if isinstance(error, NotReached) else np.inf
            continue
        if made.stride * made.tempo >= ENOUGH:
            if holds is None or holds(made.clip, STEPPER).share >= 1.0:
                return made
            first = first or made._replace(held=False)
            tried.add(trial.way)
            continue
        slow = slow or made._replace(bound=bound)
    found = first or slow
    if found is not None:
        return found
    assert reason is not None
    raise reason


class RetargetTrial(NamedTuple):
    """What is tried of steps: shares of the clip's length and tempo, the height of the CoM, how
    much lower it may be [m], the share of the width, the low-pass on trunk and arms [Hz]."""

    stride: float
    tempo: float
    low: float
    sink: float = 0.0
    spread: float = 1.0
    calm: float = SWINGING

    @property
    def way(self) -> tuple[float, float]:
        return self.stride, self.tempo


def _trials() -> Iterator[RetargetTrial]:
    """As the clip has them, the fastest first; then with a CoM that is lower where legs do not
    reach, steps that are less wide, and calmer arms."""
    yield from (RetargetTrial(*way, low) for way in TRIED for low in LOWER)
    fast = [way for way in TRIED if way[0] * way[1] >= ENOUGH]
    for spread, calm in GIVING:
        yield from (RetargetTrial(*way, LOWER[-1], SINK, spread, calm) for way in fast)


def _leaping(
    leaps: list[Leap], clip: Clip, robot: Robot, limbs: Limbs, smooth: float, lead: float
) -> Retargeted:
    """The highest jumps up to the clip's that the robot can do at 0.7 of its way and speed or more,
    slower ones where it would not stand long enough between two; if there are none, the fastest."""
    with needing("motion", "motion"):
        from .solve_tracks import solve_tracks
    solved: dict[float, Any] = {}
    longest, reason = min(leap.land - leap.lift for leap in leaps), None
    bound = f"it has to stand for {STANDS:g} s between two jumps"
    flights = [each for each in FLIGHTS if each <= longest]
    tried = [(flight, way, tempo_of(leaps, flight)) for flight, way in product(flights, WAYS)]
    tried.sort(key=lambda each: -min(each[1] * each[2], ENOUGH))  # and else the highest first
    highest = tried[0][0] if tried else 0.0
    for flight, way, tempo in tried:
        if tempo not in solved:
            tracks = find_tracks(clip.at_speed(tempo), robot, limbs, smooth)
            solved[tempo] = tracks, solve_tracks(robot, limbs, tracks, smooth)
        timed = [Leap(leap.lift / tempo, leap.land / tempo) for leap in leaps]
        tracks, one = solved[tempo]
        frames = max(round(lead / RATE), 1)
        try:
            plan, begin = plan_leaps(timed, tracks, one.qpos, robot, frames, flight, way)
            qpos = perform_plan(robot, plan, clip.name)
        except ConfigError as error:
            reason = error
            if way * tempo >= ENOUGH and flight == highest:
                bound = error.message
            continue
        made = _retargeted(one._replace(qpos=qpos), clip, robot, limbs, stride=way,
                           planted=plan.planted, begins=begin * plan.dt)  # fmt: skip
        fine = replace(made.clip, dt=plan.dt)
        return made._replace(clip=fine, flight=flight / longest, tempo=tempo,
                             bound=bound if way * tempo < ENOUGH else "")  # fmt: skip
    raise reason or ConfigError("its jumps are too short", source=clip.name, field="feet")


def retarget_freely(clip: Clip, robot: Robot, *, smooth: float = SMOOTH) -> Retargeted:
    """The postures in which a robot does what a clip shows, by kinematics, at `RATE`.

    The heading of the clip's begin becomes x. Hips and feet go where the clip's do, times the
    ratio of the legs; directions of the segments are the clip's. Soles are level. Planted ones rest
    at the median of the clip's places in the stance; between stances a foot goes the clip's way,
    and what it was off grows into what it will be off. Where the legs cannot reach, the hips get
    lower. Ways get shorter until every planted sole is within 3 mm of its place. Whether a
    controller can perform that is another question.

    Args:
        clip: of any skeleton whose hips, knees and ankles are known.
        robot: with two feet.
        smooth: half the cut-off of the low-pass on the targets [Hz].

    Raises:
        ConfigError: unknown joints, fewer than 8 frames, mink is missing.
        PoiseError: no posture keeps the soles and the limits.
    """
    with needing("motion", "motion"):
        from .solve_tracks import solve_tracks
    limbs, stride = find_limbs(robot), 1.0
    while True:
        tracks = find_tracks(clip, robot, limbs, SWIFTER * smooth, stride)
        solved = solve_tracks(robot, limbs, tracks, SWIFTER * smooth)
        if solved.sole_error < OFF or stride * SHORTER < SHORTEST:
            break
        stride *= SHORTER
    return _retargeted(solved, clip, robot, limbs, planted=tracks.planted, stride=stride)
