"""A motion with steps, or a walk, is tried before it is taken."""

from collections.abc import Callable

from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .follow import follow

STARTS, SEED = 16, 1  # of a trial; figures are of other seeds


def rehearsal(
    robot: Robot, said: Callable[[str], None] | None = None
) -> Callable[[RobotClip, str], bool]:
    """Return `holds` of `retarget_clip`: whether a controller performs a motion from a few starts
    without a fall and without steps of its own.

    `said` is called with a line before every trial.
    """

    def holds(clip: RobotClip, controller: str) -> bool:
        if said is not None:
            said(f"trying it: {controller}, {STARTS} starts")
        try:
            reference = reference_from(clip, robot, clip.about.name)
        except ConfigError:
            return False
        trials = follow(reference, controller, robot=robot, starts=STARTS, seed=SEED, patient=False)
        return not any(trial.fallen or trial.interruptions > 0 for trial in trials)

    return holds
