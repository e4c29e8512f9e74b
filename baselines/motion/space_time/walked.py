"""Commands of a step planner by which a robot walks and turns as a clip does."""

from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.balance.references.reference_motion import MOST_COMMANDS, faster
from poise.baselines.balance.references.robot_clip import RATE, RobotClip
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import (
    grounded,
    longest_flight,
    measure_contacts,
    over_ground,
)
from poise.baselines.motion.retargeting.leaps import STANDS
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.runs import runs_of
from poise.envs.robots.robot import Robot

from .in_step import BOTH, in_step
from .own_steps import (
    ASIDE_STEP,
    BACK_STEP,
    BANK,
    BEND,
    MOST_TURN,
    QUICKEST,
    TOGETHER,
    OwnSteps,
    check_changes,
    out_of_turn,
    own_steps,
)
from .turns import spread_rates
from .walk_limits import limits_of_walk

FLIGHT = 0.05  # [s] without a foot on the ground: longer is no walk; shorter, toes are unclear
STRIDE = 0.6  # [s] without a foot on the ground: longer is no run
LONGEST = 0.72  # [h] of a step: further, robots fall
WALK, WALK_FAST, LEARNED = "walk", "walk-fast", "residual-walk-fast"  # controllers, a policy
FASTEST = 0.585  # [hω] of a walk by the fast controllers: faster, robots fall
REACHES = 0.47  # [hω] that `walk-fast` reaches, whatever the command
ASKED = 1.06  # largest commanded speed over the clip's: the policy is slower than commanded
FAST_ROBOTS = ("humanoid",)  # for which the others are; others fall
LEARNED_BANK = 0.0875  # [g] of speed times turning rate, above which robots fall
ASKED_BANK = 0.091  # [g] commanded in curves at most: it goes slower than commanded
ASIDE, SPIN = 0.25, 0.19  # of the speed ahead to a side, [ω] of turning, of the policy's training
BRISK, QUICK = 0.4, 1.2  # [hω] from which steps last [1/ω] at most: longer ones, and robots fall
NOT_HELD = "the robot falls with its own steps, or does not take them"
LEAST, LEAST_TURN = 0.05, 0.1  # [hω], [rad/s]: slower is no walk


class Walked(NamedTuple):
    """How a clip is walked.

    Attributes:
        commands: (n, 5) in the clip's time.
        tempo: how many times as fast as the clip that is.
        walker: the packaged controller or policy that walks so.
        asked: its commanded speed over that speed, as it is slower.
        way: the length of its steps over the clip's.
        planted: (F, 2) the clip's stances at `RATE`, left and right, which its steps are judged by.
        bound: why its steps are not the clip's; empty where they are.
    """

    commands: np.ndarray
    tempo: float
    walker: str
    asked: float = 1.0
    way: float = 1.0
    planted: np.ndarray = np.empty((0, 2), dtype=bool)
    bound: str = ""


def walked_clip(clip: RobotClip, found: Walked, robot: Robot) -> RobotClip:
    """A robot's clip in the clip's time, walked by what is found for it, in step.

    Its stances are the clip's: soles that turn on the ground have landed.
    """
    left = int(np.argmax(foot_signs(robot)))
    planted = found.planted[:, [0, 1] if left == 0 else [1, 0]]
    return in_step(replace(clip, commands=found.commands, dt=clip.dt / found.tempo,
                           planted=planted), robot)  # fmt: skip


def find_commands(
    clip: Clip, robot: Robot, scale: float, least: float = 0.0, *, own: bool = True
) -> Walked:
    """The velocity along the heading [m/s], the turning rate [rad/s] and the time of a swing [s] of
    a clip, step by step; a time of 0 is that of the walker's gait.

    Velocities are means over two steps, times `scale`, the ratio of the legs. Steps last as the
    clip's where that is possible at `least` of its way times its tempo, unless `own` is False.
    Otherwise, where the clip is too fast for legs to follow, all is slower, and where it bends too
    sharply, steps are shorter and quicker. What a step turns too far, those around it turn
    (`spread_rates`). A run is walked.

    Raises:
        ConfigError: both feet leave the ground at once, or for 0.6 s; it takes no two steps, goes
            nowhere, or a robot reaches less than `least` of its speed.
    """
    planted = grounded(measure_contacts(clip).planted, clip.dt)
    run = _run(clip, planted)
    lands = np.sort(np.nonzero(np.diff(planted.astype(int), axis=0) > 0)[0]) * clip.dt
    if len(lands) < 2:
        raise ConfigError("its feet move, but take no two steps", source=clip.name, field="feet")
    period = float(np.median(np.diff(lands))) if len(lands) > 2 else float(np.diff(lands)[0])
    walk = over_ground(clip).faced().resampled(RATE)
    stances = planted[np.abs(walk.times[:, None] - clip.times).argmin(axis=1)]
    size = 2 * max(round(period / RATE), 1) + 1
    facing = _mean(np.unwrap(walk.facing()), size)
    velocity, turn = np.gradient(scale * walk.root[:, :2], RATE, axis=0), np.gradient(facing, RATE)
    cos, sin = np.cos(facing), np.sin(facing)
    ahead = np.gradient(_mean(_gone(cos * velocity[:, 0] + sin * velocity[:, 1]), size), RATE)
    left = np.gradient(_mean(_gone(cos * velocity[:, 1] - sin * velocity[:, 0]), size), RATE)
    h, omega = robot.height_com, robot.omega
    speed = np.hypot(ahead, left)
    each = _steps(lands, period, walk.duration)
    frames = [_frames(start, end) for start, end, _ in each]
    rates, going = (np.array([x[these].mean() for these in frames]) for x in (turn, speed))
    for these, more in zip(
        frames, spread_rates(each, rates, going, h * omega) - rates, strict=True
    ):
        turn[these] += more
    if speed.max() < LEAST * h * omega and np.abs(turn).max() < LEAST_TURN:
        raise ConfigError("its feet step, but go nowhere", source=clip.name, field="feet")
    fast, steady = robot.name in FAST_ROBOTS, limits_of_walk(robot).speed * h * omega
    fastest = FASTEST * h * omega if fast else steady
    tempo = min(fastest / max(float(speed.max()), 1e-9), 1.0)
    bend, most = float(np.abs(speed * turn).max()), BANK * robot.units.gravity
    brisk = speed > steady
    known = brisk.any() and (np.abs(left) <= ASIDE * ahead)[brisk].all()
    sharp = tempo * tempo * bend > most or tempo * speed.max() > REACHES * h * omega
    learned = bool(fast and known and sharp)
    if learned:
        most = LEARNED_BANK * robot.units.gravity
        tempo = min(tempo, SPIN * omega / max(float(np.abs(turn).max()), 1e-9))
    elif fast:
        fastest = REACHES * h * omega
        tempo = min(tempo, fastest / max(float(speed.max()), 1e-9))
    spin = MOST_TURN * omega / (QUICKEST + BOTH)
    tempo = min(tempo, np.sqrt(most / max(bend, 1e-9)), spin / max(float(np.abs(turn).max()), 1e-9))
    if tempo < least:
        bound = tempo * speed.max()
        in_curves = " in curves like its own" if bound < 0.999 * fastest else ""
        raise ConfigError(f"{run}it goes at {speed.max():.2f} m/s, and the planner of walks at "
                          f"{bound:.2f} m/s at most{in_curves}, {tempo:.2f} of it (--speed "
                          f"{tempo:.2f} plays it so)", source=clip.name, field="speed")  # fmt: skip
    rows = np.array([[start, *(rate[these].mean() for rate in (ahead, left, turn)), lasts]
                     for these, (start, _, lasts) in zip(frames, each, strict=True)])  # fmt: skip
    found = own_steps(rows, robot, least) if own else OwnSteps(NOT_HELD)
    bound = found.bound or out_of_turn(planted, clip.dt)
    check_changes(faster(rows, tempo) if found.bound else found.commands, robot, clip.name)
    if not found.bound:
        return Walked(found.commands, found.tempo, WALK, 1.0, found.way, stances, bound)
    commands = faster(rows, tempo)
    if learned:
        commands[:, 4] = 0.0  # it was trained at its gait's own
        bent = float(np.abs(commands[:, 1] * commands[:, 3]).max())
        asked = max(min(ASKED, ASKED_BANK * robot.units.gravity / max(bent, 1e-9)), 1.0)
        commands[:, 1:3] *= asked
        return Walked(commands, tempo, LEARNED, asked, 1.0, stances, bound)
    commands[:, 4] = _swings(commands, robot)
    quick = np.hypot(commands[:, 1], commands[:, 2]).max() > steady + 1e-9
    walker = WALK_FAST if quick else WALK
    return Walked(commands, tempo, walker, planted=stances, bound=bound)


def _steps(lands: np.ndarray, period: float, duration: float) -> list[tuple[float, float, float]]:
    """Begin and end of each step of a clip, and what it lasts [s]: for the first and the last one,
    which the clip cuts, and where feet land together, that is the `period`."""
    ends = [0.0]
    for time in (*lands, duration):
        if time - ends[-1] >= TOGETHER:
            ends.append(float(time))
    if len(ends) > MOST_COMMANDS:
        ends = np.linspace(0.0, duration, MOST_COMMANDS).tolist()
    pairs = list(pairwise(ends))
    inner = range(1, len(pairs) - 1) if len(ends) < MOST_COMMANDS else ()
    return [(a, b, b - a if k in inner else period) for k, (a, b) in enumerate(pairs)]


def _frames(start: float, end: float) -> slice:
    """Of the times from `start` to `end` [s]."""
    first = round(start / RATE)
    return slice(first, max(round(end / RATE), first + 1))


def _swings(commands: np.ndarray, robot: Robot) -> np.ndarray:
    """(n,) the clip's times of a swing [s], quicker where steps would be too long or bend much."""
    h, omega = robot.height_com, robot.omega
    going, aside = np.hypot(commands[:, 1], commands[:, 2]), np.abs(commands[:, 2])
    turning = np.maximum(np.abs(commands[:, 3]), 1e-9)
    limits = [ASIDE_STEP * h / np.maximum(aside, 1e-9),
              BACK_STEP * h / np.maximum(-commands[:, 1], 1e-9),
              LONGEST * h / np.maximum(going, 1e-9), MOST_TURN / turning,
              BEND * h * omega / np.maximum(going * turning, 1e-9),
              np.where(going > BRISK * h * omega, QUICK / omega, np.inf)]  # fmt: skip
    swing = np.minimum(commands[:, 4], np.min(limits, axis=0)) - BOTH / omega
    return np.asarray(np.clip(swing, QUICKEST / omega, limits_of_walk(robot).swing / omega))


def _run(clip: Clip, planted: np.ndarray) -> str:
    """What says that a clip runs; empty where it walks. Raises ConfigError where it jumps."""
    first, time = longest_flight(planted, clip.dt)
    if time <= FLIGHT:
        return ""
    says = f"both feet are off the ground for {time:.2f} s at {first * clip.dt:.2f} s"
    around, hops = round(TOGETHER / clip.dt), runs_of(np.asarray(~planted.any(axis=1))).tolist()
    both = [(a, b) for a, b in hops if a and (b - a) * clip.dt > FLIGHT
            and planted[b : b + around].any(axis=0).all()]  # fmt: skip
    if len(both) > 1:
        a, b = both[0]
        raise ConfigError(f"it hops {len(both)} times onto both feet, first for "
                          f"{(b - a) * clip.dt:.2f} s at {a * clip.dt:.2f} s: jumps are performed "
                          f"{STANDS} s apart", source=clip.name, field="speed")  # fmt: skip
    before = planted[max(first - round(TOGETHER / clip.dt), 0) : first]
    if time > STRIDE or before.any(axis=0).all():
        raise ConfigError(says, source=clip.name, field="contacts")
    return f"{says}, so that it would be walked; "


def _gone(velocity: np.ndarray) -> np.ndarray:
    """The way gone at a velocity along a heading (F,), since a way in the world bends with it."""
    return np.asarray(RATE * cumulative_trapezoid(velocity, initial=0.0))


def _mean(values: np.ndarray, size: int) -> np.ndarray:
    """The mean of so many frames around each, of a course that goes on beyond its ends."""
    half = size // 2
    slopes = [(values[min(half, len(values) - 1)] - values[0]) / half,
              (values[-1] - values[max(-half - 1, -len(values))]) / half]  # fmt: skip
    k = np.arange(1, half + 1).reshape(-1, *[1] * (values.ndim - 1))
    longer = [values[0] - k[::-1] * slopes[0], values, values[-1] + k * slopes[1]]
    return np.asarray(uniform_filter1d(np.concatenate(longer), size, axis=0)[half:-half])
