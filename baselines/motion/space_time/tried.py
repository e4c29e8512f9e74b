"""Ways to walk a clip, tried from the nearest to the clip on."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from poise.baselines.balance.references.reference_motion import faster
from poise.baselines.balance.references.robot_clip import RobotClip
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.retargeting.retarget import ENOUGH, Holds, Rehearsed, Retargeted
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .walked import (
    FAST_ROBOTS,
    LEARNED,
    WALK,
    WALK_FAST,
    Walked,
    find_commands,
    walked_clip,
)

SLOWER = (1.0, 0.9, 0.8)  # times its speed, at which a walk is tried
KEPT, LEAST = 0.9, 0.75  # of a clip's own steps: enough; less, and they are others


def held_walk(
    clip: Clip, found: Walked, free: Retargeted, robot: Robot, holds: Holds
) -> tuple[RobotClip, Walked, bool]:
    """A way to walk a clip in which no trial fails, and True; else the one that fails last.

    Tried are the steps that are `found`, then quicker ones of the planner's; each as it is and
    slower, down to `ENOUGH` of the clip's speed, then with arms that balance the robot. The first
    in which none fails and 0.9 of the clip's own steps are taken is the way. The planner's are
    taken only where the robot falls with the clip's, or takes less than 0.75 of these.
    """
    most, best = (False, Rehearsed(0.0, 0.0)), (walked_clip(free.clip, found, robot), found)
    for walk, way in _all_ways(clip, found, free, robot):
        trial = holds(walk, way.walker)
        stands = trial.share >= 1.0
        rank = (stands and (way.bound != "" or trial.kept >= LEAST), trial)
        if rank > most:
            most, best = rank, (walk, way)
        if stands and (way.bound or trial.kept >= KEPT):
            break
    return *best, most[1].share >= 1.0


def _all_ways(
    clip: Clip, found: Walked, free: Retargeted, robot: Robot
) -> Iterator[tuple[RobotClip, Walked]]:
    """Ways to walk as it is found, then with steps of the planner's, where those are others."""
    yield from _ways(free, found, robot)
    try:
        others = find_commands(clip, robot, free.scale, ENOUGH, own=False)
    except ConfigError:  # at the clip's whole way its speed may change too soon
        return
    if not np.array_equal(others.commands, found.commands):
        yield from _ways(free, others, robot)


def _ways(free: Retargeted, found: Walked, robot: Robot) -> Iterator[tuple[RobotClip, Walked]]:
    """A walk as it is found and slower, a clip's own steps by a planner for fast walks, too; with
    its arms and, where it has not learned with free ones, without."""
    walk = walked_clip(free.clip, found, robot)
    assert walk.commands is not None
    fast = found.walker == WALK and not found.bound and robot.name in FAST_ROBOTS
    slowest = min(ENOUGH / (found.way * found.tempo), 1.0)
    paces = [*(pace for pace in SLOWER if pace > slowest), slowest]
    for arms in (False,) if found.walker == LEARNED else (False, True):
        for walker in (WALK, WALK_FAST) if fast else (found.walker,):
            for pace in paces:
                yield (
                    replace(walk, about=replace(walk.about, free_arms=arms), dt=walk.dt / pace,
                            commands=faster(walk.commands, pace)),
                    found._replace(tempo=pace * found.tempo, walker=walker),
                )  # fmt: skip
