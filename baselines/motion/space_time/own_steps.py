"""A clip's own steps by a planner that walks: whether it can take them, and why not."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.reference_motion import faster
from poise.baselines.motion.clips.skeleton import SIDES
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .in_step import BOTH, EARLY
from .walk_limits import WalkLimits, limits_of_walk

SHARE = 0.7  # of a clip's way times its tempo, from which its own steps are taken
#: [h] of a step that lasts as the clip's, and [hω] of its speed, at most: less is safer
OWN = ((0.6, 0.36), (0.66, 0.4))
TOGETHER = 0.15  # [s] between two feet that land at once
ASIDE_STEP, BACK_STEP = 0.27, 0.68  # [h] that a planner steps to a side or back, at most
CHANGE, BEHIND = 0.03, 0.2  # [g] by which a planner's speed changes; [hω] that it may lag
BANK = 0.07  # [g] of speed times turning rate, above which robots fall
BEND, MOST_TURN = 0.065, 0.45  # [hω], [rad] by which velocity and heading turn in a step, at most
QUICKEST = 0.75  # [1/ω] of a swing


class OwnSteps(NamedTuple):
    """Commands (n, 5) of steps that last as a clip's, how many times as fast, and their length
    over the clip's; or what is beyond a planner (`bound`)."""

    bound: str
    commands: np.ndarray = np.empty((0, 5))
    tempo: float = 1.0
    way: float = 1.0


def own_steps(rows: np.ndarray, robot: Robot, least: float) -> OwnSteps:
    """A walk by `walk` whose steps last as the clip's, shorter and slower as need be, at `least`,
    or 0.7, of the clip's way times its tempo.

    `rows` (n, 5) are the clip's commands, with the time from one touchdown to the next [s] in place
    of that of a swing.
    """
    slower = limits_of_walk(robot).speed / WalkLimits().speed
    for far, brisk in OWN:
        found = _within(rows, robot, max(least, SHARE), far, slower * brisk)
        if not found.bound:
            break
    return found


def _within(rows: np.ndarray, robot: Robot, least: float, far: float, brisk: float) -> OwnSteps:
    """`own_steps` of `far` [h], at `brisk` [hω], at most."""
    h, omega = robot.height_com, robot.omega
    going, turning = np.hypot(rows[:, 1], rows[:, 2]), np.abs(rows[:, 3])
    times, bend = rows[:, 4], float((going * turning).max())
    turned = float((turning * times).max())
    if turned > MOST_TURN:
        return OwnSteps(
            f"a step turns by {np.degrees(turned):.0f}°: {np.degrees(MOST_TURN):.0f}° can"
        )
    longest = max(float((going * times).max()), 1e-9) / h
    aside = max(float((np.abs(rows[:, 2]) * times).max()), 1e-9) / h
    way = min(far / longest, ASIDE_STEP / aside, 1.0)
    tempos = {
        "speed": brisk * h * omega / max(way * float(going.max()), 1e-9),
        "bends": BEND * h * omega / max(way * float((going * turning * times).max()), 1e-9),
        "curves": np.sqrt(BANK * robot.units.gravity / max(way * bend, 1e-9)),
        "quick steps": float(times.min()) * omega / (QUICKEST + BOTH),
    }
    tempo = float(min(1.0, *tempos.values()))
    if way * tempo < least:
        slow = min(tempos, key=tempos.__getitem__)
        steps = f"{longest:.2f} h" + (f", {aside:.2f} h aside" if aside > ASIDE_STEP else "")
        why = [f"{way:.2f} of its length, for steps of {steps}"] if way < 1.0 else []
        why += [f"{tempo:.2f} of its tempo, for its {slow}"] if tempo < 1.0 else []
        return OwnSteps(" and ".join(why))
    if (times / tempo).max() > (slowest := (limits_of_walk(robot).swing + BOTH) / omega):
        return OwnSteps(f"a step lasts {(times / tempo).max():.2f} s: {slowest:.2f} s can")
    commands = faster(rows * [1.0, way, way, 1.0, 1.0], tempo)
    commands[:, 4] -= BOTH / omega - EARLY
    return OwnSteps("", commands, tempo, way)


def out_of_turn(planted: np.ndarray, dt: float) -> str:
    """Why feet that land in turn cannot land as a clip's (F, 2); empty where its do."""
    lands = np.argwhere(planted[1:] & ~planted[:-1])
    for (a, foot), (b, other) in pairwise(lands.tolist()):
        if (b - a) * dt < TOGETHER:
            return f"both feet land at {b * dt:.2f} s"
        if foot == other:
            return f"the {SIDES[foot]} foot lands twice in a row at {b * dt:.2f} s"
    return ""


def check_changes(commands: np.ndarray, robot: Robot, name: str) -> None:
    """Raise ConfigError for speeds that change faster than a planner's, which would lag behind."""
    most, lag = CHANGE * robot.units.gravity, np.zeros(2)
    for before, row in pairwise(commands):
        lag *= max(1.0 - most * (row[0] - before[0]) / max(float(np.hypot(*lag)), 1e-9), 0.0)
        lag += row[1:3] - before[1:3]
        if np.hypot(*lag) > BEHIND * robot.height_com * robot.omega:
            raise ConfigError(f"its speed changes by {np.hypot(*lag):.2f} m/s at {row[0]:.2f} s, "
                              f"too soon for the planner of walks, which takes {most:.2f} m/s in a "
                              "second", source=name, field="speed")  # fmt: skip
