"""How fast robots walk by the planner of `walk`, from which clips are slowed."""

from typing import NamedTuple

from poise.envs.robots.robot import Robot


class WalkLimits(NamedTuple):
    """The largest speed that is asked for, and the longest swing."""

    speed: float = 0.45  # [hω]
    swing: float = 3.0  # [1/ω]


#: of robots that fall sooner: docs/log/motion.md#on-the-g1-t1-and-h1-2026-11-30
SLOWER = {
    "booster_t1": WalkLimits(0.31),
    "unitree_g1": WalkLimits(0.32),
    "unitree_h1": WalkLimits(0.22, 1.2),
}


def limits_of_walk(robot: Robot) -> WalkLimits:
    """Return those of a robot, by its name."""
    return SLOWER.get(robot.name, WalkLimits())
