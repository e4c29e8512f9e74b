"""A motion with steps, or a walk, is tried before it is taken."""

from collections.abc import Callable

from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.baselines.motion.retargeting.retarget import Holds
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .follow import follow

STARTS, SEED = 8, 1  # of a trial; figures are of other seeds


def rehearsal(robot: Robot, said: Callable[[str], None] | None = None) -> Holds:
    """Return `holds` of `retarget_clip`: the share of a few starts until the first from which a
    controller that performs a motion falls or takes steps of its own; 1 where it does not.

    `said` is called with a line before every trial.
    """

    def holds(clip: RobotClip, controller: str) -> float:
        if said is not None:
            said(f"trying it: {controller}, {STARTS} starts")
        try:
            reference = reference_from(clip, robot, clip.about.name)
        except ConfigError:
            return 0.0
        trials = follow(reference, controller, robot=robot, starts=STARTS, seed=SEED, patient=False)
        fine = [not (trial.fallen or trial.interruptions > 0) for trial in trials]
        return 1.0 if all(fine) else fine.index(False) / STARTS

    return holds
